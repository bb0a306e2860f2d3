"""Rings around holes and pockets: what perforated plates, brackets and lattices are made of.

No part of such a solid is thicker than another, so that nothing but its holes tells where a primitive should be. Each
hole of a cross-section gives the wall around it, as wide as the wall is thick where it is thin.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy import ndimage

from ..coarse_grid import WorkingGrid
from ..region import Region, label_components
from .proposal import Proposal
from .slabs import section_cuts

SMALLEST_HOLE = 6
"""Cells of a hole in a cross-section."""

LARGEST_HOLE = 0.5
"""Most of the section's box that a hole may fill: the inside of a shell is better left to other proposals."""

MOST_HOLES = 12
"""Holes of one slab, at most: the largest."""

THIN_SHARE = 0.3
"""Quantile of the wall's thickness along the hole that makes the ring's width."""


def hole_parts(grid: WorkingGrid) -> list[Region]:
    """The walls around the holes of each slab's middle section, along each axis, with source "hole"."""
    cells = grid.cells
    regions = []
    for axis in range(3):
        one, two = (other for other in range(3) if other != axis)
        edges = [0, *section_cuts(cells, axis), cells.shape[axis]]
        for begin, end in pairwise(edges):
            along, across = cells.index[axis], (cells.index[one], cells.index[two])
            middle = along == (begin + end) // 2
            section = np.zeros((cells.shape[one], cells.shape[two]), bool)
            section[across[0][middle], across[1][middle]] = True
            slab = np.flatnonzero((along >= begin) & (along < end))
            for ring in rings(section):
                region = grid.region(slab[ring[across[0][slab], across[1][slab]]], "hole")
                if region is not None:
                    regions.append(region)
    return regions


def rings(section: np.ndarray) -> list[np.ndarray]:
    """Masks (a, b) of the wall around each hole of a cross-section (a, b), largest hole first."""
    padded = np.pad(section, 1)
    labels, count = label_components(~padded[..., None])
    labels = labels[..., 0]
    areas = np.bincount(labels.reshape(-1), minlength=count + 1)
    areas[[0, labels[0, 0]]] = 0
    found = []
    for hole in np.argsort(-areas, kind="stable")[:MOST_HOLES]:
        if areas[hole] < SMALLEST_HOLE:
            break
        if areas[hole] > LARGEST_HOLE * section.size:
            continue
        inside = labels == hole
        to_hole, to_other = (
            np.asarray(ndimage.distance_transform_edt(away)) for away in (~inside, padded | inside)
        )
        rim = (to_hole <= 1.5) & padded
        if not rim.any():
            continue
        wall = float(np.quantile((to_hole + to_other)[rim], THIN_SHARE)) - 1.0
        # A hole in the midst of much material gets a ring as wide as itself.
        width = min(wall, 0.5 * np.sqrt(areas[hole])) + 0.5
        found.append((padded & (to_hole <= max(width, 1.0)))[1:-1, 1:-1])
    return found


PROPOSAL = Proposal(
    name="hole",
    find=lambda unexplained: hole_parts(unexplained.grid),
    rank=6,
    title="walls around holes",
    first_round=True,
)
