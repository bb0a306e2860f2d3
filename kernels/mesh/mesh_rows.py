"""Distances of the cells near a mesh whose faces lie across each other: row by row, face after face.

A hierarchy of boxes finds the nearest of ordinary faces in a few steps. The boxes of thousands of large faces without
order hold nearly every cell, and each query looks at hundreds of them. Here a face is asked for the cells near its
plane only, and of those for the ones to which no face before it was nearer. Not differentiable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..runtime.launch import PLAIN_OPTIONS, launch
from .mesh_query import MeshQuery
from .slivers import seen_faces

wp.set_module_options(PLAIN_OPTIONS)

CROWDED = 32.0
"""Boxes of faces that hold a point of [-1, 1]^3, in the mean, from which on this is faster; usual are less than 2."""

LOOKED_AT = 10_000
"""Faces whose boxes tell how many there are."""


@dataclass(frozen=True)
class CellBand:
    """Closest points of the cells near a mesh, of n^3 cells of [-1, 1]^3; the other cells are unknown."""

    distance: wp.array
    """(n, n, n) float32."""
    point: wp.array
    """(n^3,) vec3, the nearest point of the mesh."""
    found: wp.array
    """(n, n, n) int32, where the cell's point is in `point`; -1 for a cell that is not near."""
    near: wp.array
    """(n, n, n) bool."""


def is_crowded(vertices: np.ndarray, faces: np.ndarray) -> bool:
    """True if so many faces lie across each other that a query of a point or ray looks at very many of them.

    Args:
        vertices: (n, 3), normalised.
        faces: (m, 3).
    """
    return len(faces) > CROWDED and boxes_per_point(vertices, faces) > CROWDED


def boxes_per_point(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Boxes of faces (m, 3), m > 0, that hold a point of [-1, 1]^3, in the mean."""
    low, high = _boxes(vertices, faces[:: -(-len(faces) // LOOKED_AT)])
    return float(np.prod(high - low, axis=1).mean()) * len(faces) / 8.0


def measure_band(query: MeshQuery, resolution: int, reach: float) -> CellBand:
    """Exact distances of the cells whose centres are nearer to the mesh than `reach`.

    Args:
        query: the mesh.
        resolution: cells along a side.
        reach: normalised.

    Raises:
        ValueError: if no cell is that near.
    """
    vertices, faces, device = query.vertices.numpy(), query.faces.numpy().reshape(-1, 3), query.device
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    length = np.linalg.norm(cross, axis=1)
    seen = seen_faces(vertices, faces)
    low, high = _boxes(vertices, faces[seen])
    corners = np.stack([a[seen], b[seen], c[seen]], axis=1)
    normal = cross[seen] / np.maximum(length[seen, None], 1e-30)
    shape = (resolution,) * 3
    band = CellBand(
        wp.empty(shape, dtype=float, device=device),
        wp.empty(resolution**3, dtype=wp.vec3, device=device),
        wp.full(shape, -1, dtype=int, device=device),
        wp.zeros(shape, dtype=wp.bool, device=device),
    )
    given = [low - reach, high + reach, normal, corners.reshape(-1, 3)]
    launch(
        measure_row_kernel,
        resolution**2,
        [*(wp.array(each, dtype=wp.vec3, device=device) for each in given), resolution, reach],
        [band.distance.flatten(), band.point, band.found.flatten(), band.near.flatten()],
        device,
        seconds_per_thread=len(corners) * 1e-8,
    )
    if not band.near.numpy().any():
        raise ValueError("the mesh has no surface inside the grid [-1, 1]^3")
    return band


def _boxes(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (m, 3) each of the boxes of faces (m, 3)."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


@wp.func_native("return wp::closest_point_to_triangle(a, b, c, point);")
def closest_on_triangle(a: wp.vec3, b: wp.vec3, c: wp.vec3, point: wp.vec3) -> wp.vec2:
    """Barycentric coordinates, of a and b, of the nearest point: what Warp's queries ask of each face."""


@wp.kernel
def measure_row_kernel(
    first: int,
    low: wp.array[wp.vec3],
    high: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    corners: wp.array[wp.vec3],
    resolution: int,
    reach: float,
    # outputs
    out_distance: wp.array[float],
    out_point: wp.array[wp.vec3],
    out_found: wp.array[int],
    out_near: wp.array[wp.bool],
):
    """Cells of a row along z: of equally near faces the first counts."""
    row = first + wp.tid()
    base = row * resolution
    spacing = 2.0 / float(resolution)
    x = (float(row // resolution) + 0.5) * spacing - 1.0
    y = (float(row % resolution) + 0.5) * spacing - 1.0
    for k in range(resolution):
        out_distance[base + k] = reach * reach
    for f in range(low.shape[0]):
        if x >= low[f][0] and x <= high[f][0] and y >= low[f][1] and y <= high[f][1]:
            a, n = corners[3 * f], normal[f]
            # Height over the plane along the row: height + slope * z.
            height = n[0] * (x - a[0]) + n[1] * (y - a[1]) - n[2] * a[2]
            slope = n[2]
            begin, end = low[f][2], high[f][2]
            if wp.abs(slope) > 1.0e-3:
                middle, half = -height / slope, reach / wp.abs(slope)
                begin, end = wp.max(begin, middle - half), wp.min(end, middle + half)
            # A cell more at both ends than rounding could take away.
            from_k = wp.max(int(wp.floor((begin + 1.0) / spacing - 0.5)), 0)
            to_k = wp.min(int(wp.ceil((end + 1.0) / spacing - 0.5)), resolution - 1)
            for k in range(from_k, to_k + 1):
                z = (float(k) + 0.5) * spacing - 1.0
                above = height + slope * z
                nearest = out_distance[base + k]
                if above * above < nearest:
                    point = wp.vec3(x, y, z)
                    b, c = corners[3 * f + 1], corners[3 * f + 2]
                    share = closest_on_triangle(a, b, c, point)
                    found = a * share[0] + b * share[1] + c * (1.0 - share[0] - share[1])
                    square = wp.length_sq(found - point)
                    if square < nearest:
                        out_distance[base + k] = square
                        out_point[base + k] = found
                        out_found[base + k] = base + k
                        out_near[base + k] = True
    for k in range(resolution):
        out_distance[base + k] = wp.sqrt(out_distance[base + k])
