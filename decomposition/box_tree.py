"""A tree of boxes: a solid cut where the boxes around the pieces shrink most, and each piece again.

What is left between a piece and its box says how far it is from being one primitive; the tree offers the pieces of
every size, from halves down to blocks, for selection to choose among.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .coarse import WorkingGrid
from .region import Region, label_components, true_box

LEAST_GAIN = 0.06
"""Share of its box that a cut has to save."""

SECOND_CUT = 0.1
"""The same for a second cut at once, on top of what one would save."""

SMALLEST_SHARE = 0.008
"""Share of the solid below which a piece is left to the other proposals."""

MOST_PIECES = 40
"""Pieces, at most: the largest ones are cut first."""


def box_tree_parts(grid: WorkingGrid) -> list[Region]:
    """Pieces at all levels of the tree but the whole, with source "block"."""
    solid = grid.depth > 0.0
    smallest = max(1, int(SMALLEST_SHARE * np.count_nonzero(solid)))
    box = true_box(solid)
    if box is None:
        return []
    waiting = [(solid[box], np.array([edge.start for edge in box]))]
    regions: list[Region] = []
    while waiting and len(regions) < MOST_PIECES:
        waiting.sort(key=lambda entry: -np.count_nonzero(entry[0]))
        mask, corner = waiting.pop(0)
        cuts = best_cuts(mask)
        if cuts is None:
            continue
        axis, places = cuts
        for begin, end in pairwise([0, *places, mask.shape[axis]]):
            for piece, at in _pieces(mask, axis, begin, end, smallest):
                full = np.zeros(solid.shape, bool)
                where = corner + at
                full[tuple(slice(a, a + n) for a, n in zip(where, piece.shape, strict=True))] = piece
                region = grid.region(full, "block")
                if region is not None:
                    regions.append(region)
                waiting.append((piece, where))
    return regions


def best_cuts(mask: np.ndarray) -> tuple[int, list[int]] | None:
    """Axis and the one or two places where cutting a tightly cropped mask (a, b, c) saves most of its box.

    A frame has no place for one cut: only with both of its sides off does what is between them get a smaller box.
    A cut c parts section c - 1 from section c. None if no cut is worth it.
    """
    best, best_saving = None, LEAST_GAIN
    for axis in range(3):
        count = mask.shape[axis]
        if count < 4:
            continue
        boxes = _range_boxes(mask, axis) / mask.size
        # [i, j]: what is left of the box after cuts at i and j; i = 0 makes it one cut.
        left = boxes[0, :, None] + boxes + boxes[:, count][None, :]
        one = 1.0 - left[0, 1:count]
        place = int(np.argmax(one)) + 1
        two = np.where(np.triu(np.ones_like(left), 2) > 0, 1.0 - left, -np.inf)[1:count, 1:count]
        first, second = (int(edge) + 1 for edge in np.unravel_index(np.argmax(two), two.shape))
        for saving, places in ((one[place - 1], [place]), (two.max() - SECOND_CUT, [first, second])):
            if saving > best_saving:
                best, best_saving = (axis, places), float(saving)
    return best


def _range_boxes(mask: np.ndarray, axis: int) -> np.ndarray:
    """Volumes (n + 1, n + 1) of the boxes round sections i .. j - 1 along an axis, 0 where there are none."""
    count = mask.shape[axis]
    index = np.arange(count)
    later = index[None, :] >= index[:, None]
    held = np.moveaxis(mask, axis, 0).reshape(count, -1).any(axis=1)
    volume = np.zeros((count + 1, count + 1))
    volume[:count, 1:] = np.where(later, index[None, :] - index[:, None] + 1, 0)
    for other in range(3):
        if other == axis:
            continue
        seen = np.asarray(mask.any(axis=3 - axis - other))
        if axis > other:
            seen = seen.T
        size = seen.shape[1]
        low = np.where(held, seen.argmax(axis=1), size)
        high = np.where(held, size - seen[:, ::-1].argmax(axis=1), 0)
        lowest = np.minimum.accumulate(np.where(later, low[None, :], size), axis=1)
        highest = np.maximum.accumulate(np.where(later, high[None, :], 0), axis=1)
        volume[:count, 1:] *= np.maximum(highest - lowest, 0)
    return volume


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
