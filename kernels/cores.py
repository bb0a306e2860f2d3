"""How many CPU cores to use. Imports nothing heavy, so that it can be asked first."""

from __future__ import annotations

import os


def core_count() -> int:
    """CPU cores to use: RESFIT_THREADS, or all that this process may run on."""
    asked = os.environ.get("RESFIT_THREADS", "")
    if asked.isdigit() and int(asked) > 0:
        return int(asked)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
