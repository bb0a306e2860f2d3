"""Dual contouring, the geometry: crossings and normals from the field, and the vertex that fits a patch's planes best.

Positions count in cells, as in `dual_contour_grid`.
"""

# No postponed annotations here: Warp reads the kernels' own.

import numpy as np
import warp as wp

from ..runtime.launch import PLAIN_OPTIONS, launch
from .dual_contour_grid import Cells, Crossings, SampledField
from .dual_contour_topology import EDGES

wp.set_module_options(PLAIN_OPTIONS)

EDGES_C = wp.constant(EDGES)
PULL = wp.constant(2e-3)
"""Pull towards the mean of the crossings, relative to the planes': decides along directions that no plane fixes."""
SLACK = 1.0
"""Vertices may leave their cell by this much (cells): corners and creases often lie just outside."""
SLACK_C = wp.constant(SLACK)
ZERO_STEPS = 24
"""Most steps along a crossed edge, by turns secant (a distance is linear but for creases) and bisection (in a thin
plate the inside is so shallow that secants hardly move)."""
NUDGE = 1e-3
"""Normals are taken this far (cells) inside: exactly on the surface a distance has none."""
PROJECTION_ROUNDS = 2
ON_SURFACE = 1e-4
"""A vertex whose field is below this many cells is left where it is."""


def refine_crossings(field: SampledField, crossings: Crossings) -> tuple[np.ndarray, np.ndarray]:
    """Root of the field on each crossed edge, and the unit normal there, both (n, 3) float32, in cells."""
    direction = np.eye(3, dtype=np.float32)[crossings.axis]
    share = _find_zeros(field, crossings, direction)
    position = (crossings.start + share[:, None] * direction).astype(np.float32)
    # Towards the inside, since a convex crease has clean normals there.
    inwards = np.where(crossings.starts_inside[:, None], -direction, direction)
    _, gradient = field.evaluate_gradient(field.points(position + NUDGE * inwards))
    normal = gradient * field.spacing.astype(np.float32)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.where(length > 1e-12, normal / np.maximum(length, 1e-12), -inwards)
    return position, normal.astype(np.float32)


def _find_zeros(field: SampledField, crossings: Crossings, direction: np.ndarray) -> np.ndarray:
    """Share (n,) of each crossed edge at which the field is zero, by the Illinois method and bisection."""
    tolerance = ON_SURFACE * float(field.spacing.min())
    start = crossings.start
    low_value = field.samples[tuple(start.T)]
    high_value = field.samples[tuple((start + direction.astype(np.int64)).T)]
    low, high = np.zeros(len(start), np.float32), np.ones(len(start), np.float32)
    share = low_value / (low_value - high_value)
    stayed = np.zeros(len(start), np.int8)
    todo = np.arange(len(start))
    for step in range(ZERO_STEPS):
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
        part = np.where(step % 2, np.float32(0.5), part)
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
