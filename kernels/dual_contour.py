"""Dual contouring: a closed triangle mesh of a field's zero set that keeps sharp edges.

One vertex per patch of surface in a grid cell (see `cell_patches`), where it fits the tangent planes at the crossed
edges best (Ju et al. 2002), and one quad per crossed edge. Crossings, normals and the final projection come from the
field itself, not from interpolated samples. Inside, positions count in cells from the grid's lower corner: there a
grid of any spacing is a grid of unit cubes.
"""

# No postponed annotations here: Warp reads the kernels' own.

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import warp as wp

from .cell_patches import EDGES, FACES, ambiguous_faces, cell_patches, edge
from .launch import PLAIN_OPTIONS, launch

wp.set_module_options(PLAIN_OPTIONS)

EDGES_C = wp.constant(EDGES)
PULL = wp.constant(2e-3)
"""Pull towards the mean of the crossings, relative to the planes': decides along directions that no plane fixes."""
SLACK = 1.0
"""Vertices may leave their cell by this much (cells): corners and creases often lie just outside."""
SLACK_C = wp.constant(SLACK)
SECANT_STEPS = 8
"""Steps of the Illinois method along a crossed edge at most; a distance field is linear there but for creases."""
NUDGE = 1e-3
"""Normals are taken this far (cells) inside: exactly on the surface a distance has none."""
PROJECTION_ROUNDS = 2
TURNED_COST = 0.05
"""What a triangle that faces the wrong way is worth in cells of distance, when quads are split."""
ON_SURFACE = 1e-4
"""A vertex whose field is below this many cells is left where it is."""
MAX_FLIPS = 4
"""Rounds of re-pairing faces where four triangles would share an edge."""
CUBE = 4
"""Side (cells) of the cubes in whose order edges and cells are listed: blocks of points are then compact."""


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


AROUND = ((1, 1), (0, 1), (0, 0), (1, 0))
"""Where a crossed edge lies in the four cells around it: offsets along the next axis and the one after it."""


def dual_contour(field: SampledField, device: wp.Device) -> tuple[np.ndarray, np.ndarray]:
    """Mesh the zero set of a field.

    Returns:
        vertices (v, 3) float32 and faces (f, 3) int32, counter-clockwise seen from outside; none without a crossing.
    """
    inside = field.samples < 0.0
    crossings = find_crossings(inside)
    if not len(crossings.axis):
        return np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32)
    cells = find_cells(inside, crossings)
    edge_patch, counts = pair_faces(field, cells)
    positions, normals = refine_crossings(field, crossings)
    vertices, first_vertex = place_vertices(cells, edge_patch, counts, positions, normals, device)
    vertices = project_vertices(field, vertices, np.repeat(cells.corner, counts, axis=0))
    quads = join_quads(crossings, cells, edge_patch, first_vertex)
    faces = split_quads(field, vertices, quads, normals)
    return field.points(vertices), faces


def cube_order(corner: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
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
    order = cube_order(start, inside.shape)
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
    order = cube_order(corner, shape)
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
    for _ in range(MAX_FLIPS):
        joined[:] = 0
        np.bitwise_or.at(joined, owner, join[shared].astype(np.int64) << face)
        patches, counts, twice = _patch_tables(cells.inside, joined)
        bad = np.bincount(shared, weights=twice[owner] >> face & 1, minlength=len(join)) == 2
        if not bad.any():
            break
        join = join ^ bad
    return patches, counts


def _patch_tables(inside: np.ndarray, joined: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`cell_patches` of many cells: (c, EDGES), (c,), (c,)."""
    kinds, which = np.unique(inside * 64 + joined, return_inverse=True)
    rows = [cell_patches(int(kind) // 64, int(kind) % 64) for kind in kinds]
    edges, counts, twice = (np.array(column) for column in zip(*rows, strict=True))
    return edges[which], counts[which], twice[which]


def refine_crossings(field: SampledField, crossings: Crossings) -> tuple[np.ndarray, np.ndarray]:
    """Where the field is zero on each crossed edge, and the unit normal there, both (n, 3) float32, in cells."""
    direction = np.eye(3, dtype=np.float32)[crossings.axis]
    share = find_zeros(field, crossings, direction)
    position = (crossings.start + share[:, None] * direction).astype(np.float32)
    # Towards the inside, since a convex crease has clean normals there.
    inwards = np.where(crossings.starts_inside[:, None], -direction, direction)
    _, gradient = field.evaluate_gradient(field.points(position + NUDGE * inwards))
    normal = gradient * field.spacing.astype(np.float32)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.where(length > 1e-12, normal / np.maximum(length, 1e-12), -inwards)
    return position, normal.astype(np.float32)


def find_zeros(field: SampledField, crossings: Crossings, direction: np.ndarray) -> np.ndarray:
    """Share (n,) of each crossed edge at which the field is zero, by the Illinois method."""
    tolerance = ON_SURFACE * float(field.spacing.min())
    start = crossings.start
    low_value = field.samples[tuple(start.T)]
    high_value = field.samples[tuple((start + direction.astype(np.int64)).T)]
    low, high = np.zeros(len(start), np.float32), np.ones(len(start), np.float32)
    share = low_value / (low_value - high_value)
    stayed = np.zeros(len(start), np.int8)
    todo = np.arange(len(start))
    for _ in range(SECANT_STEPS):
        value = field.evaluate(field.points(start[todo] + share[todo, None] * direction[todo]))
        unsettled = np.abs(value) > tolerance
        todo, value = todo[unsettled], value[unsettled]
        if not len(todo):
            break
        below = (value < 0.0) == crossings.starts_inside[todo]
        up, down = todo[below], todo[~below]
        low[up], low_value[up] = share[up], value[below]
        high[down], high_value[down] = share[down], value[~below]
        # An end that stays a second time has its value halved, else it would never move.
        high_value[up] *= np.where(stayed[up] > 0, np.float32(0.5), np.float32(1.0))
        low_value[down] *= np.where(stayed[down] < 0, np.float32(0.5), np.float32(1.0))
        stayed[up], stayed[down] = 1, -1
        gap = low_value[todo] - high_value[todo]
        part = np.where(gap == 0.0, 0.5, low_value[todo] / np.where(gap == 0.0, 1.0, gap))
        share[todo] = low[todo] + (high[todo] - low[todo]) * part
    return share


@wp.kernel
def place_vertices_kernel(
    first: int,
    corners: wp.array[wp.vec3],
    cell_edges: wp.array[int],
    edge_patch: wp.array[int],
    positions: wp.array[wp.vec3],
    normals: wp.array[wp.vec3],
    cell_of_vertex: wp.array[int],
    patch_of_vertex: wp.array[int],
    # outputs
    out_vertices: wp.array[wp.vec3],
):
    """The point that fits the tangent planes of one patch best, kept in its cell."""
    v = first + wp.tid()
    base = cell_of_vertex[v] * EDGES_C
    mean = wp.vec3()
    count = float(0.0)
    for e in range(EDGES_C):
        if edge_patch[base + e] == patch_of_vertex[v]:
            mean += positions[cell_edges[base + e]]
            count += 1.0
    mean /= count
    planes = wp.identity(3, float) * (PULL * count)
    target = wp.vec3()
    for e in range(EDGES_C):
        if edge_patch[base + e] == patch_of_vertex[v]:
            n = normals[cell_edges[base + e]]
            planes += wp.outer(n, n)
            target += n * wp.dot(n, positions[cell_edges[base + e]] - mean)
    corner = corners[cell_of_vertex[v]]
    low = corner - wp.vec3(SLACK_C, SLACK_C, SLACK_C)
    high = corner + wp.vec3(1.0 + SLACK_C, 1.0 + SLACK_C, 1.0 + SLACK_C)
    out_vertices[v] = wp.min(wp.max(mean + wp.inverse(planes) * target, low), high)


def place_vertices(
    cells: Cells,
    edge_patch: np.ndarray,
    counts: np.ndarray,
    positions: np.ndarray,
    normals: np.ndarray,
    device: wp.Device,
) -> tuple[np.ndarray, np.ndarray]:
    """A vertex per patch, cell by cell: positions (v, 3) in cells, and the first vertex of each cell (c,)."""
    first_vertex = np.cumsum(counts) - counts
    cell_of_vertex = np.repeat(np.arange(len(counts)), counts)
    patch_of_vertex = np.arange(len(cell_of_vertex)) - first_vertex[cell_of_vertex]

    def integers(values: np.ndarray) -> wp.array:
        return wp.array(np.ascontiguousarray(values.ravel(), np.int32), dtype=int, device=device)

    def vectors(values: np.ndarray) -> wp.array:
        return wp.array(np.ascontiguousarray(values, np.float32), dtype=wp.vec3, device=device)

    vertices = wp.empty(len(cell_of_vertex), dtype=wp.vec3, device=device)
    launch(
        place_vertices_kernel,
        len(cell_of_vertex),
        [
            vectors(cells.corner),
            integers(cells.edges),
            integers(edge_patch),
            vectors(positions),
            vectors(normals),
            integers(cell_of_vertex),
            integers(patch_of_vertex),
        ],
        [vertices],
        device,
        seconds_per_thread=2e-7,
    )
    return vertices.numpy().copy(), first_vertex


def project_vertices(field: SampledField, vertices: np.ndarray, corner: np.ndarray) -> np.ndarray:
    """Move vertices (v, 3) down the field onto its zero set, near their cells; a step that does not help is undone.

    Creases need none: where their planes are exact the field is zero already.
    """
    tolerance = ON_SURFACE * float(field.spacing.min())
    value, gradient = field.evaluate_gradient(field.points(vertices))
    todo = np.flatnonzero(np.abs(value) > tolerance)
    value, gradient = value[todo], gradient[todo]
    for _ in range(PROJECTION_ROUNDS):
        if not len(todo):
            break
        square = np.maximum((gradient * gradient).sum(axis=1), 1e-6)
        step = (value / square)[:, None] * gradient / field.spacing
        moved = np.clip(vertices[todo] - step, corner[todo] - SLACK, corner[todo] + 1 + SLACK)
        moved_value, moved_gradient = field.evaluate_gradient(field.points(moved))
        better = np.abs(moved_value) < np.abs(value)
        vertices[todo[better]] = moved[better]
        left = better & (np.abs(moved_value) > tolerance)
        todo, value, gradient = todo[left], moved_value[left], moved_gradient[left]
    return vertices


def join_quads(
    crossings: Crossings, cells: Cells, edge_patch: np.ndarray, first_vertex: np.ndarray
) -> np.ndarray:
    """Quads (n, 4) of vertex indices around each crossing, counter-clockwise seen from outside."""
    quads = np.empty((len(crossings.axis), 4), np.int64)
    for slot, (a, b) in enumerate(AROUND):
        cell = cells.of_crossing[:, slot]
        quads[:, slot] = first_vertex[cell] + edge_patch[cell, edge(0, a, b) + 4 * crossings.axis]
    return np.where(crossings.starts_inside[:, None], quads, quads[:, ::-1])


def split_quads(field: SampledField, vertices: np.ndarray, quads: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Triangles (2 n, 3) int32 of the quads (n, 4).

    Each takes the diagonal whose middle lies nearer to the surface, unless a triangle then looks away from the normal
    at the crossing (n, 3); the shorter diagonal on a tie.
    """
    corners = vertices[quads]
    middles = 0.5 * np.concatenate([corners[:, 0] + corners[:, 2], corners[:, 1] + corners[:, 3]])
    cell = float(field.spacing.min())
    cost = np.abs(field.evaluate(field.points(middles))).reshape(2, -1) / cell
    splits = np.array([[[0, 1, 2], [0, 2, 3]], [[1, 2, 3], [1, 3, 0]]])
    for split, triangles in enumerate(splits):
        cost[split] += 1e-3 * np.linalg.norm(corners[:, triangles[0, 0]] - corners[:, triangles[0, 2]], axis=1)
        for a, b, c in triangles:
            across = np.cross(corners[:, b] - corners[:, a], corners[:, c] - corners[:, a])
            cost[split] += TURNED_COST * ((across * normals).sum(axis=1) < 0.0)
    best = splits[(cost[0] > cost[1]).astype(int)]
    return np.take_along_axis(quads[:, None, :], best, axis=2).reshape(-1, 3).astype(np.int32)
