"""Morphology of cell grids: the deepest connected core of a given volume.

The core comes from one pass over the cells in order of depth with a union-find, instead of labelling one level after
another. That pass is a chain of dependent steps, so that it always runs as one thread on the CPU. Not differentiable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

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

    cells: np.ndarray
    """(m,) int32 flat indices, in order of depth, deepest first."""
    threshold: float
    """Depth, in cells, that all of them reach."""


def deepest_core(depth: np.ndarray, volume: int) -> Core | None:
    """The 6-connected component with at least `volume` cells whose threshold is deepest.

    Args:
        depth: (a, b, c) float32, contiguous; depth inside the solid in cells, 0 or less outside.
        volume: cells that the component must have, at least 1.

    Returns:
        The component of {depth >= threshold} for the deepest threshold (in steps of 1 / LEVELS_PER_CELL) at which one
        has `volume` cells, the largest if several have; None if none is that large at any threshold.
    """
    flat = depth.reshape(-1)
    cells = np.flatnonzero(flat > 0.0).astype(np.int32)
    if len(cells) < max(1, volume):
        return None
    levels = np.minimum(flat[cells] * LEVELS_PER_CELL, DEEPEST_LEVEL).astype(np.int16)
    order = np.argsort(DEEPEST_LEVEL - levels, kind="stable")
    cells, levels = cells[order], levels[order]
    cpu = wp.get_device("cpu")
    parent = wp.full(flat.size, -1, dtype=int, device=cpu)
    size = wp.empty(flat.size, dtype=int, device=cpu)
    found = wp.zeros(2, dtype=int, device=cpu)
    members = wp.empty(len(cells), dtype=int, device=cpu)
    launch(
        grow_core_kernel,
        1,
        [
            wp.array(cells, dtype=int, device=cpu, copy=False),
            wp.array(levels.astype(np.int32), dtype=int, device=cpu, copy=False),
            wp.vec3i(*depth.shape),
            volume,
            parent,
            size,
        ],
        [members, found],
        cpu,
    )
    count, level = found.numpy()
    if count == 0:
        return None
    return Core(members.numpy()[:count].copy(), max(float(level), 0.5) / LEVELS_PER_CELL)


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
def grow_core_kernel(
    first: int,
    cells: wp.array[int],
    levels: wp.array[int],
    shape: wp.vec3i,
    volume: int,
    parent: wp.array[int],
    size: wp.array[int],
    # outputs
    out_members: wp.array[int],
    out_found: wp.array[int],
):
    """Add cells level by level until a tree has `volume` cells; a single thread."""
    plane = shape[1] * shape[2]
    best = wp.int32(-1)
    best_size = wp.int32(0)
    done = wp.int32(0)
    for k in range(cells.shape[0]):
        if k > 0 and best_size >= volume and levels[k] != levels[k - 1]:
            break
        cell = cells[k]
        parent[cell] = cell
        size[cell] = 1
        x = cell // plane
        y = cell // shape[2] - x * shape[1]
        z = cell - (x * shape[1] + y) * shape[2]
        root = wp.int32(cell)
        if x > 0 and parent[cell - plane] >= 0:
            root = join(parent, size, root, cell - plane)
        if x + 1 < shape[0] and parent[cell + plane] >= 0:
            root = join(parent, size, root, cell + plane)
        if y > 0 and parent[cell - shape[2]] >= 0:
            root = join(parent, size, root, cell - shape[2])
        if y + 1 < shape[1] and parent[cell + shape[2]] >= 0:
            root = join(parent, size, root, cell + shape[2])
        if z > 0 and parent[cell - 1] >= 0:
            root = join(parent, size, root, cell - 1)
        if z + 1 < shape[2] and parent[cell + 1] >= 0:
            root = join(parent, size, root, cell + 1)
        if size[root] > best_size:
            best = root
            best_size = size[root]
        done = k + 1
    if best_size >= volume:
        top = find_root(parent, best)
        count = wp.int32(0)
        for k in range(done):
            if find_root(parent, cells[k]) == top:
                out_members[count] = cells[k]
                count += 1
        out_found[0] = count
        out_found[1] = levels[done - 1]
