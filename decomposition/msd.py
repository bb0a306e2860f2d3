"""Morphological shape decomposition: peel off the thickest connected part, again and again.

The paper's variant of Pitas and Venetsanopoulos, "Morphological shape decomposition" (1990): erode until only a core of
a given volume is left, dilate it back by as much, take that part away, repeat.
"""

from __future__ import annotations

import math

import numpy as np
import warp as wp
from scipy import ndimage

from ..kernels.distance_grid import distance_transform
from ..kernels.morphology import deepest_core
from .region import Region, label_components, region_from_mask
from .residual import SMALLEST_VOLUME, Residual

ITERATIONS = 7
"""Parts peeled off for one volume fraction, at most."""

CORNER_REACH = math.sqrt(3.0)
"""A box's corner is this many times the radius away from the core, from which its faces are one radius away."""

COARSE_VOLUME = 20_000
"""Residuals of more cells are decomposed at half the resolution, if that keeps their shape."""

COARSE_SHARE = 0.93
"""Share of the cells that the coarse grid must keep; thin parts vanish from it first."""

OWN_DEPTH = 0.75
"""A part shallower than half a cell is a left-over of earlier parts, unless it has this share of the depth that it
had before any was taken away: then the shape itself is that thin there."""


def decompose(
    residual: Residual, fractions: tuple[float, ...], device: wp.Device, iterations: int = ITERATIONS
) -> list[Region]:
    """Parts of the residual in order of thickness, for each volume fraction anew.

    Args:
        residual: what to take apart.
        fractions: volumes of a part's core, as shares of the residual.
        device: where distances are measured.
        iterations: parts for each fraction, at most.

    Returns:
        Regions with source "msd <fraction>"; some may be equal.
    """
    coarse = coarsen(residual) if residual.volume > COARSE_VOLUME else None
    depth = residual.depth if coarse is None else coarse
    regions = []
    for fraction in fractions:
        for part in peel(depth, fraction, device, iterations):
            mask = part if coarse is None else refine_mask(part, coarse, residual.depth > 0.0)
            region = region_from_mask(mask, residual.lower, residual.resolution, f"msd {fraction:g}")
            if region is not None and region.volume >= SMALLEST_VOLUME:
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


def coarsen(residual: Residual) -> np.ndarray | None:
    """Depth at half the resolution, in cells of that; None if too much of the residual would get lost.

    Coarse cells begin at `residual.lower`; the box is padded to an even number of cells.
    """
    pad = [(0, size % 2) for size in residual.depth.shape]
    fine = np.pad(residual.depth, pad, constant_values=-1.0) if any(p[1] for p in pad) else residual.depth
    coarse: np.ndarray = np.zeros([size // 2 for size in fine.shape], np.float32)
    for x in (0, 1):
        for y in (0, 1):
            for z in (0, 1):
                coarse += fine[x::2, y::2, z::2]
    coarse *= np.float32(1.0 / 16.0)
    kept = _double(coarse > 0.0, residual.depth.shape) & (residual.depth > 0.0)
    return coarse if np.count_nonzero(kept) >= COARSE_SHARE * residual.volume else None


def refine_mask(part: np.ndarray, coarse: np.ndarray, solid: np.ndarray) -> np.ndarray:
    """The fine cells of a coarse part.

    Fine cells of the solid whose coarse cell is outside of it go with the coarse parts that their cell touches.

    Args:
        part: (a, b, c) bool, coarse.
        coarse: (a, b, c) float32, above 0 in the coarse solid.
        solid: (2a or less, ...) bool, the fine solid.
    """
    around: np.ndarray = np.zeros(part.shape, bool)
    ndimage.binary_dilation(part, np.ones((3, 3, 3), bool), output=around)
    fringe = around & (coarse <= 0.0)
    return _double(part | fringe, solid.shape) & solid


def _double(mask: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    fine = mask.repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2)
    return fine[: shape[0], : shape[1], : shape[2]]


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
