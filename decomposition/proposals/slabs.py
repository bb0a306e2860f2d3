"""Slabs between the places where a solid's cross-section changes: what turned, stacked and extruded things are made of.

A cup is a foot, a stem, a floor and a wall along its axis. Morphological decomposition parts none of them, since they
are about as thick as each other; the cross-section jumps where one ends.
"""

from __future__ import annotations

import numpy as np

from ...kernels.grid.morphology import largest_components
from ...kernels.grid.sparse_cells import BORDER, CellSet
from ..coarse_grid import WorkingGrid
from ..region import Region
from .proposal import Proposal

LEAST_CHANGE = 0.1
"""Share of a cross-section that has to change within a few cells for a cut."""

MOST_CUTS = 6
"""Cuts across one axis, at most: where the change is greatest."""

SMALLEST_SHARE = 0.02
"""Share of the residual below which a piece is left to the other proposals."""

MOST_PIECES = 4
"""Pieces of one slab, at most."""


def section_parts(grid: WorkingGrid) -> list[Region]:
    """Connected pieces of the slabs between changes of the cross-section, along each axis, with source "slab"."""
    cells = grid.cells
    smallest = max(1, int(SMALLEST_SHARE * len(cells)))
    regions = []
    for axis in range(3):
        cuts = section_cuts(cells, axis)
        if not cuts:
            continue
        slab = np.searchsorted(cuts, cells.index[axis], side="right").astype(np.int32)
        for number in range(len(cuts) + 1):
            places = np.flatnonzero(slab == number).astype(np.int32)
            for piece in largest_components(cells, places, slab, smallest, MOST_PIECES):
                region = grid.region(piece, "slab")
                if region is not None:
                    regions.append(region)
    return regions


def section_cuts(cells: CellSet, axis: int) -> list[int]:
    """Places along an axis between which the sections of a solid are alike, ascending.

    A cut c parts section c - 1 from section c.
    """
    count, along = cells.shape[axis], cells.index[axis]
    # [step, k]: cells that sections k and k + step share.
    shared = np.stack(
        [np.bincount(along[cells.beside(axis, step) >= 0], minlength=count) for step in range(BORDER + 1)]
    )
    area, place = shared[0], np.arange(1, count)
    change = np.zeros(count)
    # Over three cells too, since a slanted face takes some; the nearer pair tells where.
    for low, high in ((place - 1, place), (np.maximum(place - 2, 0), np.minimum(place + 1, count - 1))):
        largest = np.maximum(np.maximum(area[low], area[high]), 1)
        change[1:] += 0.5 * (area[low] + area[high] - 2 * shared[high - low, low]) / largest
    cuts: list[int] = []
    for cut in np.argsort(-change, kind="stable"):
        if change[cut] < LEAST_CHANGE or len(cuts) == MOST_CUTS:
            break
        if all(abs(cut - other) > 2 for other in cuts) and 1 < cut < count - 1:
            cuts.append(int(cut))
    return sorted(cuts)


PROPOSAL = Proposal(
    name="slab",
    find=lambda unexplained: section_parts(unexplained.grid),
    rank=5,
    title="slabs",
    bulky=True,
)
