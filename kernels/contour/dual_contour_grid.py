"""Dual contouring, the grid: which edges the surface crosses, which cells it passes through, in how many patches.

Positions count in cells from the grid's lower corner: there a grid of any spacing is a grid of unit cubes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .dual_contour_topology import EDGES, FACES, ambiguous_faces, cell_patches, edge

MAX_FLIPS = 4
"""Rounds of re-pairing faces where four triangles would share an edge."""
CUBE = 4
"""Side (cells) of the cubes in whose order edges and cells are listed: blocks of points are then compact."""
AROUND = ((1, 1), (0, 1), (0, 0), (1, 0))
"""Where a crossed edge lies in the four cells around it: offsets along the next axis and the one after it."""


@dataclass(frozen=True)
class SampledField:
    """A field, and its samples at the points lower + spacing * (i, j, k)."""

    samples: np.ndarray
    """(nx, ny, nz) float32, negative inside, positive all over the border."""
    lower: np.ndarray
    """(3,)"""
    spacing: np.ndarray
    """(3,)"""
    evaluate: Callable[[np.ndarray], np.ndarray]
    """Field (n,) at points (n, 3)."""
    evaluate_gradient: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    """Field (n,) and gradient (n, 3) at points (n, 3)."""

    def points(self, cells: np.ndarray) -> np.ndarray:
        """Points (n, 3) float32 from positions in cells."""
        return (self.lower + self.spacing * cells).astype(np.float32)


@dataclass(frozen=True)
class Crossings:
    """Grid edges whose ends lie on different sides."""

    axis: np.ndarray
    """(n,) direction."""
    start: np.ndarray
    """(n, 3) int64, grid point at the lower end."""
    starts_inside: np.ndarray
    """(n,) bool."""


@dataclass(frozen=True)
class Cells:
    """Cells that the surface passes through."""

    corner: np.ndarray
    """(c, 3) int64, lower corner."""
    inside: np.ndarray
    """(c,) bits of the corners inside."""
    edges: np.ndarray
    """(c, EDGES) index of the crossing, -1 where the edge is not crossed."""
    of_crossing: np.ndarray
    """(n, 4) the cells around each crossing, counter-clockwise seen from the end of its axis."""


def _cube_order(corner: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Order that lists grid points (n, 3) cube by cube."""
    i, j, k = (corner // CUBE).T
    return np.argsort((i * shape[1] + j) * shape[2] + k, kind="stable")


def find_crossings(inside: np.ndarray) -> Crossings:
    """Grid edges whose ends lie on different sides, from the signs (nx, ny, nz)."""
    axes, starts = [], []
    for axis in range(3):
        low, high = [slice(None)] * 3, [slice(None)] * 3
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        crossed = inside[tuple(low)] != inside[tuple(high)]
        start = np.stack(np.unravel_index(np.flatnonzero(crossed), crossed.shape), axis=1)
        starts.append(start)
        axes.append(np.full(len(start), axis))
    axis, start = np.concatenate(axes), np.concatenate(starts)
    order = _cube_order(start, inside.shape)
    start = start[order]
    return Crossings(axis[order], start, inside[tuple(start.T)])


def find_cells(inside: np.ndarray, crossings: Crossings) -> Cells:
    """The cells around the crossings, and which crossing each of their edges is."""
    shape = inside.shape
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    axis = crossings.axis
    # A crossing next to the border would have cells beyond it; the border is all outside, one layer deep.
    base = crossings.start @ strides
    step_one, step_two = strides[(axis + 1) % 3], strides[(axis + 2) % 3]
    ids = np.stack([base - a * step_one - b * step_two for a, b in AROUND], axis=1)

    active = np.zeros(inside.size, bool)
    active[ids] = True
    found = np.flatnonzero(active)
    corner = np.stack(np.unravel_index(found, shape), axis=1)
    order = _cube_order(corner, shape)
    found, corner = found[order], corner[order]
    index = np.empty(inside.size, np.int32)
    index[found] = np.arange(len(found), dtype=np.int32)
    of_crossing = index[ids]

    edges = np.full((len(found), EDGES), -1, np.int32)
    for slot, (a, b) in enumerate(AROUND):
        edges[of_crossing[:, slot], edge(0, a, b) + 4 * axis] = np.arange(len(axis))
    flat = inside.ravel()
    bits = np.zeros(len(found), np.int64)
    for number in range(8):
        offset = strides @ (number & 1, number >> 1 & 1, number >> 2)
        bits |= flat[found + offset].astype(np.int64) << number
    return Cells(corner, bits, edges, of_crossing)


def pair_faces(field: SampledField, cells: Cells) -> tuple[np.ndarray, np.ndarray]:
    """Patches of every cell, with ambiguous faces paired as the field at their middle says.

    Returns:
        Patch of each edge (c, EDGES), -1 where it is not crossed, and number of patches (c,).
    """
    ambiguous = np.array([ambiguous_faces(bits) for bits in range(256)])[cells.inside]
    owner, face = np.nonzero(ambiguous[:, None] >> np.arange(FACES) & 1)
    joined = np.zeros(len(ambiguous), np.int64)
    if not len(owner):
        return _patch_tables(cells.inside, joined)[:2]
    # Two cells name the same face: by its axis and lower corner.
    axis, side = face // 2, face % 2
    place = cells.corner[owner] + side[:, None] * np.eye(3, dtype=np.int64)[axis]
    _, first, shared = np.unique(
        np.column_stack([axis, place]), axis=0, return_index=True, return_inverse=True
    )
    shared = shared.ravel()
    middle = place[first] + 0.5 * (1 - np.eye(3)[axis[first]])
    join = field.evaluate(field.points(middle)) < 0.0
    for _ in range(MAX_FLIPS + 1):
        joined[:] = 0
        np.bitwise_or.at(joined, owner, join[shared].astype(np.int64) << face)
        twice = _patch_tables(cells.inside, joined)[2]
        bad = np.bincount(shared, weights=twice[owner] >> face & 1, minlength=len(join)) == 2
        if not bad.any():
            break
        join = join ^ bad
    return _patch_tables(cells.inside, joined)[:2]


def _patch_tables(inside: np.ndarray, joined: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`cell_patches` of many cells: (c, EDGES), (c,), (c,)."""
    kinds, which = np.unique(inside * 64 + joined, return_inverse=True)
    rows = [cell_patches(int(kind) // 64, int(kind) % 64) for kind in kinds]
    edges, counts, twice = (np.array(column) for column in zip(*rows, strict=True))
    return edges[which], counts[which], twice[which]
