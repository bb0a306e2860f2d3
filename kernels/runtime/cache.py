"""The folder in which Warp keeps compiled kernels, or another one where that cannot be written."""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from pathlib import Path

import warp as wp

from resfit.errors import InputError

VARIABLE = "WARP_CACHE_PATH"
"""Environment variable with the folder of the user's choice."""


def init_warp() -> str:
    """Initialise Warp, with a temporary folder where its cache cannot be written; a sentence about that, or nothing.

    Kernels that were compiled into the cache before are used all the same.

    Raises:
        InputError: if there is no folder for temporary files either.
    """
    try:
        wp.init()
        if _can_write(Path(wp.config.kernel_cache_dir or "")):
            return ""
    except OSError:
        # Making the cache is the last thing that Warp does; which folder it is, it has said then.
        if wp.config.kernel_cache_dir is None:
            raise
    usual = Path(wp.config.kernel_cache_dir or "")
    try:
        folder = _private_folder() / wp.config.version
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(
            f"compiled kernels can be kept neither in '{usual}' nor in a temporary folder; set {VARIABLE} to a folder"
            " that can be written."
        ) from error
    _link_entries(usual, folder)
    # Warp adds its version by itself when it starts, and not afterwards.
    wp.config.kernel_cache_dir = str(folder.parent)
    wp.init()
    wp.config.kernel_cache_dir = str(folder)
    return (
        f"the kernel cache '{usual}' cannot be written; '{folder}' is used instead (set {VARIABLE} to choose"
        " another folder)."
    )


def _can_write(folder: Path) -> bool:
    """Make a folder, and see whether files can be made in it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except (OSError, ValueError):
        return False


def _private_folder() -> Path:
    """A temporary folder that is the same each time, if nobody else could have put something into it."""
    if not hasattr(os, "getuid"):
        return Path(tempfile.mkdtemp(prefix="resfit-kernels-"))
    folder = Path(tempfile.gettempdir(), f"resfit-kernels-{os.getuid()}")
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    found = folder.lstat()
    ours = folder.is_dir() and not folder.is_symlink() and found.st_uid == os.getuid()
    if ours and not found.st_mode & 0o077:
        return folder
    return Path(tempfile.mkdtemp(prefix="resfit-kernels-"))


def _link_entries(source: Path, folder: Path) -> None:
    """Have in `folder` what there is in a cache that can only be read."""
    with suppress(OSError):
        for entry in source.iterdir():
            link = folder / entry.name
            if link.is_symlink() and not link.exists():
                link.unlink()
            if not link.exists():
                link.symlink_to(entry)
