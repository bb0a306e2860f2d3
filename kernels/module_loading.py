"""Loading Warp modules, each once, on any thread; a notice where they have to be compiled first."""

from __future__ import annotations

import os
import sys
import threading
import time

import warp as wp

from .forks import unforked

_NOTICE_SECONDS = 0.7
"""A module that takes longer than this is worth a notice, if it is being compiled."""

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
                wp.load_module(module, device=device)
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
        sys.stderr.write("resfit: compiling kernels for this machine (first run only, then cached)...\n")
        sys.stderr.flush()


def is_cached(module: wp.Module, device: wp.Device) -> bool:
    """Whether Warp's cache holds the machine code of a module."""
    block_dim = 1 if device.is_cpu else module.options["block_dim"]
    folder = os.path.join(wp.config.kernel_cache_dir, module.get_module_identifier(block_dim))
    # The name depends on the processor, too. Warp tells it in no public way.
    return os.path.exists(os.path.join(folder, module._get_compile_output_name(device, block_dim=block_dim)))
