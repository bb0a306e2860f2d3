"""Morphology of cell grids: the deepest connected core of a given volume.

The core comes from one pass over the cells in order of depth with a union-find, instead of labelling one level after
another. That pass is a chain of dependent steps, so that it always runs as one thread on the CPU. Not differentiable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from .cells import CellSet, find_root, on_cpu
from .launch import PLAIN_OPTIONS, launch

wp.set_module_options(PLAIN_OPTIONS)

LEVELS_PER_CELL = 8
"""Depths are compared in steps of this share of a cell: cells of one level join before volumes are compared, so that
the core does not depend on the order of cells whose depths differ by rounding."""

DEEPEST_LEVEL = 32767
"""Levels are sorted as 16 bit numbers, which NumPy does by counting."""


@dataclass(frozen=True)
class Core:
    """A connected part of the cells deeper than a threshold."""

    places: np.ndarray
    """(m,) int32, of its cells in the set, in order of depth, deepest first."""
    threshold: float
    """Depth, in cells, that all of them reach."""


def deepest_core(cells: CellSet, depth: np.ndarray, volume: int) -> Core | None:
    """The 6-connected component with at least `volume` cells whose threshold is deepest.

    Args:
        cells: the solid, or more.
        depth: (m,) float32, of each of the cells; 0 or less at those that no longer belong to the solid.
        volume: cells that the component must have, at least 1.

    Returns:
        The component of {depth >= threshold} for the deepest threshold (in steps of 1 / LEVELS_PER_CELL) at which one
        has `volume` cells, the largest if several have; None if none is that large at any threshold.
    """
    places = np.flatnonzero(depth > 0.0).astype(np.int32)
    if len(places) < max(1, volume):
        return None
    levels = np.minimum(depth[places] * LEVELS_PER_CELL, DEEPEST_LEVEL).astype(np.int16)
    order = np.argsort(DEEPEST_LEVEL - levels, kind="stable")
    places, levels = places[order], levels[order].astype(np.int32)
    flat, place_at, _, strides = cells.arrays
    parent, size = np.full(len(cells), -1, np.int32), np.empty(len(cells), np.int32)
    members, found = np.empty(len(places), np.int32), np.zeros(2, np.int32)
    launch(
        grow_core_kernel,
        1,
        [on_cpu(places), on_cpu(levels), flat, place_at, strides, volume, on_cpu(parent), on_cpu(size)],
        [on_cpu(members), on_cpu(found)],
        flat.device,
    )
    count, level = found
    if count == 0:
        return None
    return Core(members[:count].copy(), max(float(level), 0.5) / LEVELS_PER_CELL)


@wp.func
def join(parent: wp.array[int], size: wp.array[int], a: int, b: int) -> int:
    """Join the trees of two cells, the smaller below the larger; the root of both."""
    high = find_root(parent, a)
    low = find_root(parent, b)
    if high != low:
        if size[high] < size[low]:
            other = high
            high = low
            low = other
        parent[low] = high
        size[high] = size[high] + size[low]
    return high


@wp.kernel
def grow_core_kernel(
    first: int,
    places: wp.array[int],
    levels: wp.array[int],
    flat: wp.array[int],
    place_at: wp.array[int],
    strides: wp.vec3i,
    volume: int,
    parent: wp.array[int],
    size: wp.array[int],
    # outputs
    out_members: wp.array[int],
    out_found: wp.array[int],
):
    """Add cells level by level until a tree has `volume` cells; a single thread."""
    best = wp.int32(-1)
    best_size = wp.int32(0)
    done = wp.int32(0)
    for k in range(places.shape[0]):
        if k > 0 and best_size >= volume and levels[k] != levels[k - 1]:
            break
        cell = places[k]
        parent[cell] = cell
        size[cell] = 1
        root = wp.int32(cell)
        for axis in range(3):
            before = place_at[flat[cell] - strides[axis]]
            if before >= 0 and parent[before] >= 0:
                root = join(parent, size, root, before)
            after = place_at[flat[cell] + strides[axis]]
            if after >= 0 and parent[after] >= 0:
                root = join(parent, size, root, after)
        if size[root] > best_size:
            best = root
            best_size = size[root]
        done = k + 1
    if best_size >= volume:
        top = find_root(parent, best)
        count = wp.int32(0)
        for k in range(done):
            if find_root(parent, places[k]) == top:
                out_members[count] = places[k]
                count += 1
        out_found[0] = count
        out_found[1] = levels[done - 1]
