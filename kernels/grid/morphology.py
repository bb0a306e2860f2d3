"""Morphology of sets of cells: connected parts, and the deepest connected core of a given volume.

The core comes from one pass over the cells in order of depth with a union-find, instead of labelling one level after
another. Such a pass is a chain of dependent steps, so that it always runs as one thread on the CPU. Not differentiable.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import warp as wp

from ..runtime.launch import PLAIN_OPTIONS, launch
from .sparse_cells import CellSet, on_cpu

wp.set_module_options(PLAIN_OPTIONS)

LEVELS_PER_CELL = 8
"""Depths are compared in steps of this share of a cell: cells of one level join before volumes are compared, so that
the core does not depend on the order of cells whose depths differ by rounding."""

DEEPEST_LEVEL = 32767
"""Levels are sorted as 16 bit numbers, which NumPy does by counting."""


_FACE_STEPS = np.array([[-1, 0, 0], [0, -1, 0], [0, 0, -1]])
_FULL_STEPS = np.array([step for step in product((-1, 0, 1), repeat=3) if step < (0, 0, 0)])
"""Steps (k, 3) to the neighbours that come before a cell."""


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
    flat, place_at, strides = cells.arrays
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


def components(
    cells: CellSet, places: np.ndarray, key: np.ndarray, full: bool = False
) -> tuple[np.ndarray, int]:
    """The connected parts of some of the cells of a set.

    Args:
        cells: the set.
        places: (k,) int32, ascending: the cells to look at.
        key: (m,) int32 of every cell of the set: neighbours are connected if their keys are equal. No cell left
            out may have the key of one looked at.
        full: whether cells that share an edge or a corner are neighbours (26), or only those that share a face (6).

    Returns:
        The part (k,) int32 of each cell, from 0 in the order of their first cells, and how many there are.
    """
    flat, place_at, _ = cells.arrays
    steps = _FULL_STEPS if full else _FACE_STEPS
    offsets = (steps @ cells.strides).astype(np.int32)
    parent = np.empty(len(cells), np.int32)
    found, count = np.empty(len(places), np.int32), np.zeros(1, np.int32)
    launch(
        label_cells_kernel,
        1,
        [on_cpu(places), on_cpu(key), flat, place_at, on_cpu(offsets), on_cpu(parent)],
        [on_cpu(found), on_cpu(count)],
        flat.device,
    )
    return found, int(count[0])


def largest_components(
    cells: CellSet, places: np.ndarray, key: np.ndarray, smallest: int, most: int, full: bool = False
) -> list[np.ndarray]:
    """Places of at most `most` components, of at least `smallest` cells, largest first; see `components`."""
    if len(places) < smallest:
        return []
    found, count = components(cells, places, key, full)
    volumes = np.bincount(found, minlength=count)
    chosen = np.argsort(-volumes, kind="stable")[:most]
    return [places[found == part] for part in chosen if volumes[part] >= smallest]


@wp.func
def find_root(parent: wp.array[int], cell: int) -> int:
    """Root of a cell's tree; halves the path on the way."""
    i = cell
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


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
def label_cells_kernel(
    first: int,
    places: wp.array[int],
    key: wp.array[int],
    flat: wp.array[int],
    place_at: wp.array[int],
    offsets: wp.array[int],
    parent: wp.array[int],
    # outputs
    out_label: wp.array[int],
    out_count: wp.array[int],
):
    """Number the connected parts; a single thread. The root of a tree is its first cell."""
    for k in range(places.shape[0]):
        cell = places[k]
        parent[cell] = cell
        root = wp.int32(cell)
        for step in range(offsets.shape[0]):
            other = place_at[flat[cell] + offsets[step]]
            if other >= 0 and key[other] == key[cell]:
                joined = find_root(parent, other)
                if joined < root:
                    parent[root] = joined
                    root = joined
                else:
                    parent[joined] = root
    count = wp.int32(0)
    for k in range(places.shape[0]):
        cell = places[k]
        if parent[cell] == cell:
            # A root's number stands where no place is: below -1.
            parent[cell] = -2 - count
            out_label[k] = count
            count += 1
        else:
            i = wp.int32(cell)
            while parent[i] >= 0:
                i = parent[i]
            out_label[k] = -2 - parent[i]
            parent[cell] = parent[i]
    out_count[0] = count


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
