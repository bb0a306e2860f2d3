"""Inside or outside of a mesh at single points: winding numbers, and the cheaper look at a cell already decided.

Not differentiable.
"""

from __future__ import annotations

import warp as wp

from ..field.points import point_blocks
from ..runtime.launch import PLAIN_OPTIONS, launch
from .mesh_query import WINDING_ACCURACY, MeshQuery, winding_number
from .mesh_rows import CROWDED, boxes_per_point
from .solid_angles import summed_winding_numbers

wp.set_module_options(PLAIN_OPTIONS)

MANY_ANGLES = 1_000_000
"""Solid angles from which on it matters how they are added up: about as long as it takes to ask."""

FACES_PER_BOX = 256
"""With fewer faces than this for each box that holds a point, in the mean, the plain sum over all is faster."""

UNSEEN = wp.constant(-1)
"""Answer for a point that sees the centre of none of the cells around it."""


def winding_numbers(query: MeshQuery, points: wp.array) -> wp.array:
    """Winding number of the mesh about each of the points (n,) vec3, to about 0.015; (n,) float32.

    A whole number where the mesh closes; positive where its faces are counter-clockwise seen from outside. It
    takes 5 us near a plain surface, and 50 near a mesh of many layers.
    """
    if len(points) * query.face_count > MANY_ANGLES and lies_across_itself(query):
        return summed_winding_numbers(query, point_blocks(points.numpy(), query.device))
    winding = wp.empty(len(points), dtype=float, device=query.device)
    launch(
        measure_winding_kernel,
        len(points),
        [query.mesh.id, points, WINDING_ACCURACY],
        [winding],
        query.device,
        seconds_per_thread=5e-6,
    )
    return winding


def lies_across_itself(query: MeshQuery) -> bool:
    """True if so many faces are near any point that a hierarchy of them only costs time."""
    boxes = boxes_per_point(query.vertices.numpy(), query.faces.numpy().reshape(-1, 3))
    return boxes > max(CROWDED, query.face_count / FACES_PER_BOX)


def look_at_cells(query: MeshQuery, points: wp.array, inside: wp.array) -> wp.array:
    """Point containment in the mesh, by the nearest cell whose centre a point sees: no face lies between.

    Args:
        query: the mesh.
        points: (n,) vec3.
        inside: (k, k, k) bool, what is known of the cell centres of [-1, 1]^3.

    Returns:
        (n,) int32: 1 inside, 0 outside, -1 where none of the eight centres around a point is seen, or the point
        is beyond the grid.
    """
    found = wp.empty(len(points), dtype=int, device=query.device)
    launch(
        look_at_cells_kernel,
        len(points),
        [query.mesh.id, points, inside.flatten(), inside.shape[0]],
        [found],
        query.device,
        seconds_per_thread=1e-6,
    )
    return found


@wp.kernel
def measure_winding_kernel(
    first: int,
    mesh: wp.uint64,
    points: wp.array[wp.vec3],
    accuracy: float,
    # outputs
    out_winding: wp.array[float],
):
    i = first + wp.tid()
    out_winding[i] = winding_number(mesh, points[i], accuracy)


@wp.kernel
def look_at_cells_kernel(
    first: int,
    mesh: wp.uint64,
    points: wp.array[wp.vec3],
    inside: wp.array[wp.bool],
    resolution: int,
    # outputs
    out_found: wp.array[int],
):
    i = first + wp.tid()
    point = points[i]
    spacing = 2.0 / float(resolution)
    place = (point + wp.vec3(1.0, 1.0, 1.0)) / spacing
    x, y, z = int(wp.floor(place[0])), int(wp.floor(place[1])), int(wp.floor(place[2]))
    # The neighbours across the sides of its cell that the point is nearest to.
    step_x = wp.where(place[0] - float(x) < 0.5, -1, 1)
    step_y = wp.where(place[1] - float(y) < 0.5, -1, 1)
    step_z = wp.where(place[2] - float(z) < 0.5, -1, 1)
    found = wp.int32(UNSEEN)
    k = wp.int32(0)
    while k < 8 and found == UNSEEN:
        a, b, c = x + step_x * (k & 1), y + step_y * ((k >> 1) & 1), z + step_z * (k >> 2)
        k += 1
        if wp.min(a, wp.min(b, c)) >= 0 and wp.max(a, wp.max(b, c)) < resolution:
            centre = wp.vec3(
                (float(a) + 0.5) * spacing - 1.0,
                (float(b) + 0.5) * spacing - 1.0,
                (float(c) + 0.5) * spacing - 1.0,
            )
            way = centre - point
            length = wp.length(way)
            seen = wp.bool(True)
            if length > 1.0e-7:
                seen = not wp.mesh_query_ray_anyhit(mesh, point, way / length, length)
            if seen:
                found = wp.where(inside[(a * resolution + b) * resolution + c], 1, 0)
    out_found[i] = found
