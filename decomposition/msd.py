"""Morphological shape decomposition: peel off the thickest connected part, again and again.

The paper's variant of Pitas and Venetsanopoulos, "Morphological shape decomposition" (1990): erode until only a core of
a given volume is left, dilate it back by as much, take that part away, repeat.
"""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..kernels.distance_grid import distance_transform
from ..kernels.morphology import deepest_core
from .coarse import WorkingGrid
from .region import Region, label_components

ITERATIONS = 7
"""Parts peeled off for one volume fraction, at most."""

CORNER_REACH = math.sqrt(3.0)
"""A box's corner is this many times the radius away from the core, from which its faces are one radius away."""

OWN_DEPTH = 0.75
"""A part shallower than half a cell is a left-over of earlier parts, unless it has this share of the depth that it
had before any was taken away: then the shape itself is that thin there."""


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
    regions = []
    for fraction in fractions:
        for part in peel(grid.depth, fraction, device, iterations):
            region = grid.region(part, f"msd {fraction:g}")
            if region is not None:
                regions.append(region)
    return regions


def peel(
    depth: np.ndarray, fraction: float, device: wp.Device, iterations: int = ITERATIONS
) -> list[np.ndarray]:
    """Masks (a, b, c) of the parts of a solid, thickest first; no cell is in two of them.

    Args:
        depth: (a, b, c) float32, contiguous; depth inside the solid in cells, 0 or less outside.
        fraction: volume of a part's core as a share of the solid.
        device: where distances are measured.
        iterations: parts, at most.
    """
    left = depth.copy()
    volume = max(1, math.ceil(fraction * np.count_nonzero(depth > 0.0)))
    parts: list[np.ndarray] = []
    for _ in range(iterations):
        core = deepest_core(left, volume)
        if core is None:
            break
        part, box = grow_back(left, core.cells, core.threshold, device)
        deepest = float(left[box][part].max())
        if deepest > 0.5 or deepest >= OWN_DEPTH * float(depth[box][part].max()):
            mask = np.zeros(depth.shape, bool)
            mask[box] = part
            parts.append(mask)
        take_away(left, part, box, device)
    return parts


def grow_back(
    depth: np.ndarray, core: np.ndarray, radius: float, device: wp.Device
) -> tuple[np.ndarray, tuple[slice, slice, slice]]:
    """Dilate a core within its solid.

    A ball does not reach into corners and along edges. What is left there, cut off from the rest of the solid and no
    further from the core than a box's corner would be, belongs to the part.

    Args:
        depth: (a, b, c) float32, above 0 in the solid.
        core: (m,) flat indices of its cells.
        radius: of the dilation, in cells.
        device: where distances are measured.

    Returns:
        The mask of the part on a box, and that box.
    """
    index = np.unravel_index(core, depth.shape)
    reach = CORNER_REACH * radius + 1.5
    box = _box_around(index, math.ceil(reach) + 1, depth.shape)
    seed = np.zeros([edge.stop - edge.start for edge in box], bool)
    seed[index[0] - box[0].start, index[1] - box[1].start, index[2] - box[2].start] = True
    away = _distances(seed, device)
    solid = depth[box] > 0.0
    part = solid & (away <= radius + 0.5)
    labels, count = label_components(solid & ~part)
    if count:
        absorbed = np.ones(count + 1, bool)
        absorbed[labels[away > reach]] = False
        absorbed[0] = False
        part |= absorbed[labels]
    return part, box


def take_away(
    depth: np.ndarray, part: np.ndarray, box: tuple[slice, slice, slice], device: wp.Device
) -> None:
    """Remove a part from a solid, in place: nothing is deeper than its distance to what was removed.

    Args:
        depth: (a, b, c) float32, above 0 in the solid; changed.
        part: mask on `box`.
        box: where in `depth`.
        device: where distances are measured.
    """
    margin = math.ceil(float(depth.max())) + 1
    wide = tuple(
        slice(max(0, edge.start - margin), min(size, edge.stop + margin))
        for edge, size in zip(box, depth.shape, strict=True)
    )
    removed = np.zeros([edge.stop - edge.start for edge in wide], bool)
    inner = tuple(
        slice(edge.start - outer.start, edge.stop - outer.start)
        for edge, outer in zip(box, wide, strict=True)
    )
    removed[inner] = part
    depth[wide] = np.minimum(depth[wide], _distances(removed, device) - np.float32(0.5))


def _box_around(
    index: tuple[np.ndarray, ...], margin: int, shape: tuple[int, ...]
) -> tuple[slice, slice, slice]:
    x, y, z = (
        slice(max(0, int(i.min()) - margin), min(size, int(i.max()) + 1 + margin))
        for i, size in zip(index, shape, strict=True)
    )
    return x, y, z


def _distances(mask: np.ndarray, device: wp.Device) -> np.ndarray:
    return distance_transform(wp.array(mask, dtype=wp.bool, device=device)).numpy()
