"""Names of temporary files and folders: unique on a shared volume, and telling whose they are.

A name is `.STEM.resfit-PLACE-PROCESS-RANDOM.tmp`. PLACE stands for one start of one machine and one space of process
numbers, such as a container: only there does PROCESS say anything.
"""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import socket
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path

MAX_STEM_BYTES = 60
"""File systems allow 255 bytes a name, encrypted ones 143; the rest of a name of ours takes up to 60."""

OLD_SECONDS = 24 * 3600.0
"""What a process left whose end cannot be known is taken for abandoned after this long."""

PATTERN = re.compile(r"\..*\.resfit-(?:([0-9a-f]{8})-)?(\d{1,9})(?:-[0-9a-f]{16})?\.tmp(?:\.\w+)?", re.DOTALL)
"""Earlier releases wrote neither place nor random digits."""


def temporary_name(stem: str = "", suffix: str = "") -> str:
    """A new name that no other process or thread has, on any machine.

    Args:
        stem: that it begins with; as many whole letters are taken as fit.
        suffix: that it ends with, such as `.json`.
    """
    begin = stem.encode("utf-8", "ignore")[:MAX_STEM_BYTES].decode("utf-8", "ignore")
    return f".{begin}.resfit-{_place()}-{os.getpid()}-{secrets.token_hex(8)}.tmp{suffix}"


def is_temporary(name: str) -> bool:
    """True if a file or folder of this name is a temporary one of ours."""
    return PATTERN.fullmatch(name) is not None


def abandoned(folder: Path) -> Iterator[Path]:
    """Temporary files and folders of ours in `folder` that no process works on any more; none if it cannot be read."""
    try:
        with os.scandir(folder) as entries:
            names = [entry.name for entry in entries if is_temporary(entry.name)]
    except OSError:
        return
    for name in names:
        if _is_abandoned(folder / name):
            yield folder / name


def _is_abandoned(path: Path) -> bool:
    found = PATTERN.fullmatch(path.name)
    if found is None:
        return False
    process = int(found[2])
    if found[1] == _place():
        # If its number has gone to another process, it stays until that one has ended.
        return process != os.getpid() and not _is_running(process)
    return _is_old(path)


def _is_old(path: Path) -> bool:
    try:
        return time.time() - path.lstat().st_mtime > OLD_SECONDS
    except OSError:
        return False


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


@cache
def _place() -> str:
    """Eight digits for where process numbers mean what they mean here; unlike all others where that is not known."""
    try:
        started = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii")
        numbers = os.readlink("/proc/self/ns/pid")
    except (OSError, ValueError):
        return secrets.token_hex(4)
    return hashlib.sha256(f"{socket.gethostname()} {started} {numbers}".encode()).hexdigest()[:8]
