"""Morphological shape decomposition: peel off the thickest connected part, again and again.

The paper's variant of Pitas and Venetsanopoulos, "Morphological shape decomposition" (1990): erode until only a core of
a given volume is left, dilate it back by as much, take that part away, repeat.
"""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ...kernels.grid.distance_grid import distance_transform
from ...kernels.grid.morphology import components, deepest_core
from ...kernels.grid.sparse_cells import CellSet, squared_distances
from ...kernels.runtime.launch import serial_device
from ..coarse_grid import WorkingGrid
from ..region import Region
from .proposal import Proposal

FRACTIONS = (0.005, 0.03, 0.12)
"""Volume fractions of the decompositions: small ones find knobs and limbs, large ones the body."""

ITERATIONS = 7
"""Parts peeled off for one volume fraction, at most."""

CORNER_REACH = math.sqrt(3.0)
"""A box's corner is this many times the radius away from the core, from which its faces are one radius away."""

OWN_DEPTH = 0.75
"""A part shallower than half a cell is a left-over of earlier parts, unless it has this share of the depth that it
had before any was taken away: then the shape itself is that thin there."""

PAIRS_PER_CELL, PAIRS_PER_TRANSFORM = 120, 3_000_000
"""Pairs of cells whose distance takes as long to measure as a distance transform takes for a cell, and at least."""


def decompose(
    grid: WorkingGrid, fractions: tuple[float, ...], device: wp.Device, iterations: int = ITERATIONS
) -> list[Region]:
    """Parts of a residual in order of thickness, for each volume fraction anew.

    Args:
        grid: what to take apart.
        fractions: volumes of a part's core, as shares of the residual.
        device: where distances are measured.
        iterations: parts for each fraction, at most.

    Returns:
        Regions with source "msd <fraction>"; some may be equal.
    """
    cells, regions = grid.cells, []
    for fraction in fractions:
        for part in peel(cells, grid.depths, fraction, device, iterations):
            region = grid.region(part, f"msd {fraction:g}")
            if region is not None:
                regions.append(region)
    return regions


def peel(
    cells: CellSet, depth: np.ndarray, fraction: float, device: wp.Device, iterations: int = ITERATIONS
) -> list[np.ndarray]:
    """Places (k,) in `cells` of the parts of a solid, thickest first; no cell is in two of them.

    Args:
        cells: the solid.
        depth: (m,) float32 of its cells, in cells.
        fraction: volume of a part's core as a share of the solid.
        device: where distances are measured.
        iterations: parts, at most.
    """
    left = depth.copy()
    volume = max(1, math.ceil(fraction * len(cells)))
    parts: list[np.ndarray] = []
    for _ in range(iterations):
        core = deepest_core(cells, left, volume)
        if core is None:
            break
        part = _grow_back(cells, left, core.places, core.threshold, device)
        deepest = float(left[part].max())
        if deepest > 0.5 or deepest >= OWN_DEPTH * float(depth[part].max()):
            parts.append(part)
        _take_away(cells, left, part, device)
    return parts


def _grow_back(
    cells: CellSet, left: np.ndarray, core: np.ndarray, radius: float, device: wp.Device
) -> np.ndarray:
    """Dilate a core within what is left of its solid.

    A ball does not reach into corners and along edges. What is left there, cut off from the rest of the solid and no
    further from the core than a box's corner would be, belongs to the part.

    Args:
        cells: the solid.
        left: (m,) float32, depth of its cells, above 0 in what is left of it.
        core: places of the core's cells.
        radius: of the dilation, in cells.
        device: where distances are measured.

    Returns:
        Places of the part's cells, ascending.
    """
    reach = CORNER_REACH * radius + 1.5
    # A cell more than the reach, so that what goes on beyond shows that it does.
    near, away = _distances(cells, left, core, math.ceil(reach) + 1, device)
    held = away <= radius + 0.5
    rest, beyond = near[~held], away[~held] > reach
    if not beyond.all():
        key = np.full(len(cells), -1, np.int32)
        key[rest] = 0
        pieces, count = components(cells, rest, key)
        absorbed = np.ones(count, bool)
        absorbed[pieces[beyond]] = False
        held[~held] = absorbed[pieces]
    return near[held]


def _take_away(cells: CellSet, left: np.ndarray, part: np.ndarray, device: wp.Device) -> None:
    """Remove a part from a solid: nothing is deeper than its distance to what was removed.

    Args:
        cells: the solid.
        left: (m,) float32, depth of its cells; changed.
        part: places of the part's cells.
        device: where distances are measured.
    """
    near, away = _distances(cells, left, part, math.ceil(float(left.max())) + 1, device)
    left[near] = np.minimum(left[near], away - np.float32(0.5))


def _distances(
    cells: CellSet, left: np.ndarray, seeds: np.ndarray, margin: int, device: wp.Device
) -> tuple[np.ndarray, np.ndarray]:
    """The cells left in the box round the seeds with a margin, (k,) int32 places, and how far they are from a seed."""
    target = cells.at(seeds)
    low = np.maximum(target.min(axis=1) - margin, 0)
    high = np.minimum(target.max(axis=1) + margin + 1, cells.shape)
    held = left > 0.0
    for axis in range(3):
        held &= (cells.index[axis] >= low[axis]) & (cells.index[axis] < high[axis])
    near = np.flatnonzero(held).astype(np.int32)
    index = cells.at(near)
    if len(near) * len(seeds) < PAIRS_PER_CELL * np.prod(high - low) + PAIRS_PER_TRANSFORM:
        return near, np.sqrt(squared_distances(index, target, serial_device()))
    mask = np.zeros(high - low, bool)
    mask[tuple(target - low[:, None])] = True
    away = distance_transform(wp.array(mask, dtype=wp.bool, device=device)).numpy()
    return near, away[tuple(index - low[:, None])]


PROPOSAL = Proposal(
    name="msd",
    find=lambda unexplained: decompose(unexplained.grid, FRACTIONS, unexplained.device),
    rank=2,
)
