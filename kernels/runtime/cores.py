"""Number of CPU cores to use. Imports nothing heavy, so that it can be asked first."""

from __future__ import annotations

import os

MOST_THREADS = 64
"""RESFIT_THREADS may ask for so many where there are fewer cores: more are only in each other's way."""


def core_count() -> int:
    """CPU cores to use: RESFIT_THREADS, or all that this process may run on.

    RESFIT_THREADS is a whole number from 1; one that is larger than MOST_THREADS and all cores stands for the larger of
    these. Anything else is as if it were not set.
    """
    if hasattr(os, "sched_getaffinity"):
        present = len(os.sched_getaffinity(0))
    else:
        present = os.cpu_count() or 1
    asked = os.environ.get("RESFIT_THREADS", "").strip().lstrip("0")
    if not (asked.isascii() and asked.isdigit()):
        return present
    most = max(present, MOST_THREADS)
    # Python makes no number of thousands of digits.
    return min(int(asked), most) if len(asked) < 10 else most
