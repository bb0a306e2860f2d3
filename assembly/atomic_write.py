"""Files appear whole or not at all: written under a temporary name in the same folder, then renamed."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from resfit.errors import InputError

from .temporary import abandoned, temporary_name


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary path to write to: becomes `path` when the block ends well, is removed when it does not.

    Raises:
        InputError: if the file cannot be written; what was at `path` before is untouched.
    """
    final = Path(path)
    if final.is_dir():
        raise InputError(f"cannot write {final}: it is a folder")
    # The suffix stays, because some writers choose the format by it.
    temporary = final.with_name(temporary_name(final.stem, final.suffix))
    try:
        yield temporary
        sync(temporary)
        os.replace(temporary, final)
    except OSError as error:
        raise InputError(f"cannot write {final}: {error.strerror or 'the file system refused'}") from error
    finally:
        with suppress(OSError):
            temporary.unlink()
    for left in abandoned(final.parent):
        # Folders are left to who makes them.
        with suppress(OSError):
            left.unlink()


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write `content` to `path` at once.

    Raises:
        InputError: if the file cannot be written; what was at `path` before is untouched.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def sync(path: Path) -> None:
    """Have a file or folder on the disk before anything that comes later, as far as the file system can.

    Raises:
        OSError: if there is no room for it, or the disk fails.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(descriptor)
    except OSError as error:
        # Some file systems, and folders on others, know no such request.
        if error.errno in (errno.EIO, errno.ENOSPC, errno.EDQUOT):
            raise
    finally:
        os.close(descriptor)
