"""An order of points in which neighbours in the list are neighbours in space: a Hilbert curve through 32^3 cells.

Blocks of consecutive points then have small bounding spheres, smaller than along a Morton curve, which jumps.
"""

from __future__ import annotations

from functools import cache

import numpy as np

BITS = 5
"""Bits of a cell along each axis: 15 in all, so that codes fit 16 bits, which numpy sorts by radix."""


@cache
def hilbert_codes() -> np.ndarray:
    """Place on the curve of each cell x + 32 y + 1024 z, (32768,) uint16 (Skilling's transform)."""
    cells = np.arange(1 << (3 * BITS))
    axes = [(cells >> (BITS * axis)) & ((1 << BITS) - 1) for axis in range(3)]
    for bit in range(BITS - 1, 0, -1):
        below = (1 << bit) - 1
        for axis in range(3):
            turned = (axes[axis] >> bit) & 1 == 1
            swapped = np.where(turned, 0, (axes[0] ^ axes[axis]) & below)
            axes[0] = np.where(turned, axes[0] ^ below, axes[0] ^ swapped)
            axes[axis] = axes[axis] ^ swapped
    for axis in (1, 2):
        axes[axis] = axes[axis] ^ axes[axis - 1]
    flip = np.zeros_like(cells)
    for bit in range(BITS - 1, 0, -1):
        flip = np.where((axes[2] >> bit) & 1 == 1, flip ^ ((1 << bit) - 1), flip)
    code = np.zeros_like(cells)
    for bit in range(BITS - 1, -1, -1):
        for axis in range(3):
            code = (code << 1) | (((axes[axis] ^ flip) >> bit) & 1)
    return code.astype(np.uint16)


def curve_codes(points: np.ndarray) -> np.ndarray:
    """Places (n,) uint16, below 2^15, of points (n, 3) on the curve through their bounding cube."""
    # Axis by axis: numpy is many times slower over the short axis of (n, 3).
    axes = np.ascontiguousarray(np.asarray(points, np.float32).T)
    low = [axis.min() for axis in axes]
    size = max(*(axis.max() - least for axis, least in zip(axes, low, strict=True)), 1e-9)
    code = np.zeros(len(points), np.int32)
    for number, (axis, least) in enumerate(zip(axes, low, strict=True)):
        cell = ((axis - least) * np.float32((1 << BITS) / size)).astype(np.int32)
        code |= np.minimum(cell, (1 << BITS) - 1) << (BITS * number)
    return hilbert_codes()[code]
