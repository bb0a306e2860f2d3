"""Loading Warp modules, each once, on any thread; a notice where they have to be compiled first."""

from __future__ import annotations

import os
import shutil
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import warp as wp

from .forks import unforked

_NOTICE_SECONDS = 0.7
"""A module that takes longer than this is worth a notice, if it is being compiled."""

_LAST_BYTES = 64
"""An object file ends in a table of its sections or their names, and so do those of GPUs: never in so many zeros."""

_lock = threading.Lock()
_loaded: set[tuple[str, str]] = set()
_locks: dict[tuple[str, str], threading.Lock] = {}
_noticed = False
compile_seconds = 0.0
"""Seconds spent in compiling or loading modules so far, added up over threads."""


def load(kernel: wp.Kernel, device: wp.Device) -> None:
    """Compile or load the module of `kernel`."""
    load_module(kernel.module, device)


def load_module(module: wp.Module, device: wp.Device) -> None:
    """Compile or load a module, with one notice on stderr if compiling takes long enough to be noticed.

    Several threads may load different modules at once; those that want the same one wait for the first.
    """
    global compile_seconds
    key = (module.name, device.alias)
    if key in _loaded:
        return
    with unforked():
        with _lock:
            lock = _locks.setdefault(key, threading.Lock())
        with lock:
            if key in _loaded:
                return
            notice = threading.Timer(_NOTICE_SECONDS, _notice_compiling, (module, device))
            notice.daemon = True
            notice.start()
            begin = time.perf_counter()
            try:
                _load_or_compile(module, device)
            finally:
                notice.cancel()
            with _lock:
                compile_seconds += time.perf_counter() - begin
                _loaded.add(key)


def _notice_compiling(module: wp.Module, device: wp.Device) -> None:
    """Say that kernels are being compiled, once; on a busy machine loading compiled ones takes as long."""
    global _noticed
    if _noticed or is_cached(module, device):
        return
    with _lock:
        # Several modules are compiled at once, and take equally long to be noticed.
        first, _noticed = not _noticed, True
    if first:
        with suppress(OSError, ValueError, AttributeError):
            sys.stderr.write("resfit: compiling kernels for this machine (first run only, then cached)...\n")
            sys.stderr.flush()


def _load_or_compile(module: wp.Module, device: wp.Device) -> None:
    """Load a module; what a full disk or a power cut has left of it in the cache is removed and compiled again."""
    if _ends_in_zeros(_cached_code(module, device)):
        _remove_cached(module, device)
    try:
        wp.load_module(module, device=device)
    except Exception:
        if not is_cached(module, device):
            raise
        _remove_cached(module, device)
        wp.load_module(module, device=device)


def is_cached(module: wp.Module, device: wp.Device) -> bool:
    """True if Warp's cache holds the machine code of a module."""
    return _cached_code(module, device).exists()


def _ends_in_zeros(code: Path) -> bool:
    """True if a machine-code file is empty or lacks its end: Warp loads zeros as a module without kernels."""
    with suppress(OSError), code.open("rb") as stream:
        stream.seek(max(0, stream.seek(0, os.SEEK_END) - _LAST_BYTES))
        return not any(stream.read())
    return False


def _remove_cached(module: wp.Module, device: wp.Device) -> None:
    """Take a module out of Warp's cache; of a cache that can only be read, the link to it."""
    folder = _cached_code(module, device).parent
    if folder.is_symlink():
        folder.unlink()
    else:
        shutil.rmtree(folder, ignore_errors=True)


def _cached_code(module: wp.Module, device: wp.Device) -> Path:
    """The file in Warp's cache for the machine code of a module."""
    block_dim = 1 if device.is_cpu else module.options["block_dim"]
    # The name depends on the processor, too. Warp tells it in no public way.
    name = module._get_compile_output_name(device, block_dim=block_dim)
    return Path(wp.config.kernel_cache_dir or "", module.get_module_identifier(block_dim), name)
