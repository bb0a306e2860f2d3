"""Two folders change places in one operation, and one process at a time replaces what is in a folder."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

AT_FDCWD, RENAME_EXCHANGE = -100, 2
"""Of Linux."""

LOCK_SECONDS = 20.0
"""Replacing takes milliseconds: who holds a lock for longer has been stopped, or holds it for another purpose."""


def exchange(one: Path, other: Path) -> bool:
    """Let two folders change places at once, as no reader can miss; False, and nothing done, where that cannot be."""
    import ctypes

    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError, TypeError):
        # Not Linux, or an old C library.
        return False
    paths = (os.fsencode(one), os.fsencode(other))
    return rename(AT_FDCWD, paths[0], AT_FDCWD, paths[1], RENAME_EXCHANGE) == 0


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Within, no other process or thread that asks for the same is in the folder, as far as its file system knows.

    Raises:
        OSError: if the folder is not there.
    """
    if os.name == "nt":
        # Folders cannot be opened there.
        yield
        return
    descriptor = _lock(folder)
    try:
        yield
    finally:
        os.close(descriptor)


def _lock(folder: Path) -> int:
    """A descriptor of the folder that is at this path once the lock is held: another one may have come to be there."""
    end = time.monotonic() + LOCK_SECONDS
    while True:
        descriptor = os.open(folder, os.O_RDONLY)
        held = _try_lock(descriptor)
        with suppress(OSError):
            if held and os.path.samestat(os.fstat(descriptor), os.stat(folder)):
                return descriptor
        if time.monotonic() > end:
            return descriptor
        os.close(descriptor)
        if not held:
            time.sleep(0.01)


def _try_lock(descriptor: int) -> bool:
    """Try to lock: True if the lock is held now; also where there are no locks."""
    try:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except (ImportError, OSError):
        return True
    return True
