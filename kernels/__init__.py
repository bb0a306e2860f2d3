"""All Warp code, on flat arrays; knows no other folder."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import warp as wp


def warm(device: wp.Device) -> float:
    """Compile ahead every kernel that a command may need on `device`, by running each once on next to nothing.

    Returns:
        Seconds spent; next to none where they are cached already.
    """
    from .warm import warm_kernels

    return warm_kernels(device)
