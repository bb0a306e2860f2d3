"""Check that this process may use the memory that fitting takes. Imports nothing heavy."""

from __future__ import annotations

from resfit.errors import InputError

NEEDED_BYTES = 1_500_000_000
"""Addresses that Warp, its compiler and the numerical libraries take for the smallest fit; most are only reserved."""


def require_address_space() -> None:
    """Refuse to begin under a limit of memory (ulimit -v) that is too low: the compiler would abort the process.

    Raises:
        InputError: if so.
    """
    try:
        import resource
    except ImportError:  # Windows knows no such limit.
        return
    allowed = resource.getrlimit(resource.RLIMIT_AS)[0]
    if allowed != resource.RLIM_INFINITY and allowed < NEEDED_BYTES:
        raise InputError(
            f"this process may use {allowed / 1e9:.1f} GB of memory (ulimit -v), but Warp and its compiler reserve"
            f" {NEEDED_BYTES / 1e9:.1f} GB; raise the limit."
        )
