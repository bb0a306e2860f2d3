"""Plates and beams that lie along the axes: what furniture, brackets and housings are made of.

Morphological decomposition cannot part walls of one thickness that meet: they are as deep as each other. The lengths
of the runs of cells through a cell along x, y and z tell them apart.
"""

from __future__ import annotations

import numpy as np

from ...kernels.grid.morphology import largest_components
from ..coarse_grid import WorkingGrid
from ..region import Region
from .proposal import Proposal

SLIMNESS = 2
"""A plate is this many times wider than thick, a beam as many times longer than wide."""

SMALLEST_SHARE = 0.01
"""Share of the residual below which a plate or beam is left to the other proposals."""

MOST_PARTS = 8
"""Plates across one axis, and beams along it, at most."""


def straight_parts(grid: WorkingGrid) -> list[Region]:
    """Connected plates across each axis and beams along it, with source "plate" and "beam"."""
    cells = grid.cells
    lengths = cells.run_lengths()
    smallest = max(1, int(SMALLEST_SHARE * len(cells)))
    regions = []
    for axis in range(3):
        along, one, two = lengths[axis], lengths[axis - 2], lengths[axis - 1]
        plates = along * SLIMNESS <= np.minimum(one, two)
        beams = along >= SLIMNESS * np.maximum(one, two)
        for held, source in ((plates, "plate"), (beams, "beam")):
            places = np.flatnonzero(held).astype(np.int32)
            for part in largest_components(cells, places, held.astype(np.int32), smallest, MOST_PARTS):
                region = grid.region(part, source)
                if region is not None:
                    regions.append(region)
    return regions


PROPOSAL = Proposal(
    name="straight",
    find=lambda unexplained: straight_parts(unexplained.grid),
    rank=3,
    sources=("plate", "beam"),
)
