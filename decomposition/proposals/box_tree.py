"""A tree of boxes: a solid cut where the boxes around the pieces shrink most, and each piece again.

What is left between a piece and its box says how far it is from being one primitive; the tree offers the pieces of
every size, from halves down to blocks, for selection to choose among.
"""

from __future__ import annotations

import numpy as np

from ...kernels.grid.morphology import components
from ..coarse_grid import WorkingGrid
from ..region import Region
from .proposal import Proposal

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
    cells = grid.cells
    smallest = max(1, int(SMALLEST_SHARE * len(cells)))
    slab = np.zeros(len(cells), np.int32)
    slabs = 1
    waiting = [cells.all_places()]
    regions: list[Region] = []
    while waiting and len(regions) < MOST_PIECES:
        waiting.sort(key=lambda piece: -len(piece))
        mother = waiting.pop(0)
        index = cells.at(mother)
        lower = index.min(axis=1)
        cuts = best_cuts(index - lower[:, None])
        if cuts is None:
            continue
        axis, places = cuts
        slab[mother] = slabs + np.searchsorted(places, index[axis] - lower[axis], side="right")
        slabs += len(places) + 1
        found, count = components(cells, mother, slab)
        large = np.flatnonzero(np.bincount(found, minlength=count) >= smallest)
        pieces = [mother[found == piece] for piece in large]
        # Slab by slab: a piece is of the slab that any of its cells is in.
        for piece in sorted(pieces, key=lambda piece: slab[piece[0]]):
            waiting.append(piece)
            region = grid.region(piece, "block")
            if region is not None:
                regions.append(region)
    return regions


def best_cuts(index: np.ndarray) -> tuple[int, list[int]] | None:
    """Axis and the one or two places where cutting a solid saves most of its box.

    A frame has no place for one cut: only with both of its sides off does what is between them get a smaller box.

    Args:
        index: (3, k) coordinates of its cells in its box.

    Returns:
        A cut c parts section c - 1 from section c. None if no cut is worth it.
    """
    shape = index.max(axis=1) + 1
    # [axis]: where the box seen along it holds a cell.
    shadows = [np.zeros(np.delete(shape, axis), bool) for axis in range(3)]
    for axis, shadow in enumerate(shadows):
        one, two = (other for other in range(3) if other != axis)
        shadow.reshape(-1)[index[one] * shape[two] + index[two]] = True
    size = int(shape.prod())
    best, best_saving = None, LEAST_GAIN
    for axis in range(3):
        count = int(shape[axis])
        if count < 4:
            continue
        boxes = _range_boxes(shadows, axis) / size
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


def _range_boxes(shadows: list[np.ndarray], axis: int) -> np.ndarray:
    """Volumes (n + 1, n + 1) of the boxes round sections i .. j - 1 along an axis, 0 where there are none."""
    # [section, place along the axis that is neither this one nor the one seen along].
    views = [seen if axis < 3 - axis - k else seen.T for k, seen in enumerate(shadows) if k != axis]
    count = len(views[0])
    index = np.arange(count)
    later = index[None, :] >= index[:, None]
    held = views[0].any(axis=1)
    volume = np.zeros((count + 1, count + 1))
    volume[:count, 1:] = np.where(later, index[None, :] - index[:, None] + 1, 0)
    for seen in views:
        size = seen.shape[1]
        low = np.where(held, seen.argmax(axis=1), size)
        high = np.where(held, size - seen[:, ::-1].argmax(axis=1), 0)
        lowest = np.minimum.accumulate(np.where(later, low[None, :], size), axis=1)
        highest = np.maximum.accumulate(np.where(later, high[None, :], 0), axis=1)
        volume[:count, 1:] *= np.maximum(highest - lowest, 0)
    return volume


PROPOSAL = Proposal(
    name="block",
    find=lambda unexplained: box_tree_parts(unexplained.grid),
    rank=4,
    title="tree of boxes",
)
