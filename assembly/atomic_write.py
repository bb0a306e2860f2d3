"""Files appear whole or not at all: written under a temporary name in the same folder, then renamed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from resfit.errors import InputError


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
    temporary = final.with_name(f".{final.stem[:60]}.{os.getpid()}.tmp{final.suffix}")
    try:
        yield temporary
        os.replace(temporary, final)
    except OSError as error:
        raise InputError(f"cannot write {final}: {error.strerror or 'the file system refused'}") from error
    finally:
        with suppress(OSError):
            temporary.unlink()


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write `content` to `path` at once.

    Raises:
        InputError: if the file cannot be written; what was at `path` before is untouched.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(content)
