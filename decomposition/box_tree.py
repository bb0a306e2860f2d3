"""A tree of boxes: a solid cut in two where the boxes around the pieces shrink most, and each piece again.

What is left between a piece and its box says how far it is from being one primitive; the tree offers the pieces of
every size, from halves down to blocks, for selection to choose among. An approximate convex decomposition in the same
spirit costs a thousand times as much.
"""

from __future__ import annotations

import numpy as np

from .coarse import WorkingGrid
from .region import Region, label_components, true_box

LEAST_GAIN = 0.06
"""Share of its box that a cut has to save."""

SMALLEST_SHARE = 0.008
"""Share of the solid below which a piece is left to the other proposals."""

MOST_PIECES = 40
"""Pieces, at most: the largest ones are cut first."""


def box_tree_parts(grid: WorkingGrid) -> list[Region]:
    """Pieces at all levels of the tree but the whole, with source "block"."""
    solid = grid.depth > 0.0
    smallest = max(1, int(SMALLEST_SHARE * np.count_nonzero(solid)))
    waiting = [(solid, np.zeros(3, int))]
    regions: list[Region] = []
    while waiting and len(regions) < MOST_PIECES:
        waiting.sort(key=lambda entry: -np.count_nonzero(entry[0]))
        mask, corner = waiting.pop(0)
        cut = best_cut(mask)
        if cut is None:
            continue
        axis, place = cut
        for begin, end in ((0, place), (place, mask.shape[axis])):
            for piece, at in _pieces(mask, axis, begin, end, smallest):
                full = np.zeros(solid.shape, bool)
                where = corner + at
                full[tuple(slice(a, a + n) for a, n in zip(where, piece.shape, strict=True))] = piece
                region = grid.region(full, "block")
                if region is not None:
                    regions.append(region)
                waiting.append((piece, where))
    return regions


def best_cut(mask: np.ndarray) -> tuple[int, int] | None:
    """Axis and place where cutting a tightly cropped mask (a, b, c) saves most of its box; None if none is worth it.

    A cut c parts section c - 1 from section c.
    """
    whole = mask.size
    best, best_left = None, (1.0 - LEAST_GAIN) * whole
    for axis in range(3):
        count = mask.shape[axis]
        if count < 4:
            continue
        before = np.arange(1, count) * _growing_area(mask, axis)[:-1]
        after = np.arange(1, count)[::-1] * _growing_area(np.flip(mask, axis), axis)[-2::-1]
        left = before + after
        place = int(np.argmin(left))
        if left[place] < best_left:
            best, best_left = (axis, place + 1), float(left[place])
    return best


def _growing_area(mask: np.ndarray, axis: int) -> np.ndarray:
    """Area (n,) of the rectangle round the first 1, 2, ... n sections along an axis together."""
    area = np.ones(mask.shape[axis])
    for other in range(3):
        if other == axis:
            continue
        third = 3 - axis - other
        seen = mask.any(axis=third)
        if axis > other:
            seen = seen.T
        held = np.maximum.accumulate(seen, axis=0)
        first = held.argmax(axis=1)
        last = held.shape[1] - held[:, ::-1].argmax(axis=1)
        area *= np.where(held.any(axis=1), last - first, 0)
    return area


def _pieces(
    mask: np.ndarray, axis: int, begin: int, end: int, smallest: int
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Components (6) of a slab of a mask, cropped, and where each begins in the mask."""
    slab: list[slice] = [slice(None)] * 3
    slab[axis] = slice(begin, end)
    labels, count = label_components(mask[tuple(slab)])
    found = []
    for label in range(1, count + 1):
        piece = labels == label
        if np.count_nonzero(piece) < smallest:
            continue
        box = true_box(piece)
        assert box is not None
        at = np.array([edge.start for edge in box])
        at[axis] += begin
        found.append((piece[box], at))
    return found
