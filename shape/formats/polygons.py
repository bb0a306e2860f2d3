"""Polygons cut into triangles, concave ones by ear clipping."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

REFLEX = -1e-6
"""A corner is reflex where its signed area is below this share of the polygon's: float32 rounding stays above."""

MANY_CORNERS = 1000
"""Convex polygons with more corners are halved again and again: of a fan each triangle would be as long as all."""

Array = npt.NDArray[np.int64]


def triangulate(vertices: npt.NDArray[np.float64], corners: Array, counts: Array) -> tuple[Array, Array]:
    """Triangles of planar or nearly planar polygons, which keep the polygons' orientation and order.

    Triangles pass as they are. A convex polygon becomes a fan round its first corner, (0, 1, 2), (0, 2, 3), ..., or is
    halved again and again if it has more than MANY_CORNERS. A concave one is cut by ear clipping in the plane of its
    area vector (Newell's normal). Every edge of a polygon is an edge of a triangle, so that a closed surface stays
    closed.

    Args:
        vertices: (n, 3), any frame.
        corners: (sum of counts,) indices into `vertices`, polygon after polygon.
        counts: (p,) corners of each polygon. Those with fewer than three give no triangle.

    Returns:
        (m, 3) indices into `vertices`, and (m,) the polygon of each.
    """
    ends = np.cumsum(counts)
    if len(counts) and counts.min() == counts.max() == 3:
        return corners.reshape(-1, 3), np.arange(len(counts))
    faces, owners = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for count in np.unique(counts[counts >= 3]):
        found = np.flatnonzero(counts == count)
        rings = corners[(ends[found] - count)[:, None] + np.arange(count)]
        fans = _halves(count) if count > MANY_CORNERS else _fan(count)
        cut = np.broadcast_to(fans, (len(found), *fans.shape)).copy()
        if count > 3:
            normals, concave = _concave(vertices[rings])
            for number in np.flatnonzero(concave):
                ears = _clip_ears(_flat(vertices[rings[number]], normals[number]))
                cut[number] = fans if ears is None else ears
        faces.append(np.take_along_axis(rings, cut.reshape(len(found), -1), axis=1).reshape(-1, 3))
        owners.append(np.repeat(found, count - 2))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(faces)[order], owner[order]


def _fan(count: int) -> Array:
    """Triangles (count - 2, 3) of a convex polygon round its first corner."""
    steps = np.arange(1, count - 1)
    return np.stack([np.zeros_like(steps), steps, steps + 1], axis=1)


def _halves(count: int) -> Array:
    """Triangles (count - 2, 3) of a convex polygon: the largest over half of its corners, then those on its sides."""
    found = []
    start, end = np.zeros(1, np.int64), np.full(1, count - 1)
    while len(start):
        middle = (start + end) // 2
        found.append(np.stack([start, middle, end], axis=1))
        start, end = np.concatenate([start, middle]), np.concatenate([middle, end])
        start, end = start[end - start > 1], end[end - start > 1]
    return np.concatenate(found)


def _concave(points: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]:
    """Area vectors (p, 3) of polygons (p, k, 3), and whether each has a reflex corner."""
    away = points - points[:, :1]
    normals = np.cross(away, np.roll(away, -1, axis=1)).sum(axis=1)
    before, after = points - np.roll(points, 1, axis=1), np.roll(points, -1, axis=1) - points
    turns = np.einsum("pkc,pc->pk", np.cross(before, after), normals)
    square = np.einsum("pc,pc->p", normals, normals)
    # Coordinates that are no numbers, or overflow, compare as convex: they are refused elsewhere.
    return normals, (turns < REFLEX * square[:, None]).any(axis=1)


def _flat(points: npt.NDArray[np.float64], normal: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Points (k, 3) in coordinates (k, 2) of the plane with a normal, seen against it: orientation is kept."""
    normal = normal / np.linalg.norm(normal)
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    away = points - points[0]
    return np.stack([away @ first, away @ np.cross(normal, first)], axis=1)


def _clip_ears(ring: npt.NDArray[np.float64]) -> Array | None:
    """Triangles (k - 2, 3) of a polygon (k, 2) that runs counter-clockwise; None where it crosses itself."""
    import mapbox_earcut

    count = len(ring)
    scaled = np.ascontiguousarray(ring / max(np.abs(ring).max(), np.finfo(float).tiny))
    found = mapbox_earcut.triangulate_float64(scaled, np.array([count], np.uint32)).reshape(-1, 3)
    a, b, c = scaled[found].transpose(1, 2, 0)
    turned = (b[0] - a[0]) * (c[1] - a[1]) < (b[1] - a[1]) * (c[0] - a[0])
    triangles = [
        tuple(int(k) for k in (row[::-1] if back else row)) for row, back in zip(found, turned, strict=True)
    ]
    return _put_back(triangles, count)


def _put_back(triangles: list[tuple[int, ...]], count: int) -> Array | None:
    """The same triangles with the corners that ear clipping has left out because they lie on a straight edge.

    Left out they would leave a T-junction: the polygon on the other side of the edge ends there.
    """
    edges = {(row[k], row[(k + 1) % 3]) for row in triangles for k in range(3)}
    outer = {edge for edge in edges if edge[::-1] not in edges}
    left_out = [(start + step) % count for start, end in outer for step in range(1, (end - start) % count)]
    if sorted([*left_out, *{corner for row in triangles for corner in row}]) != list(range(count)):
        return None

    def split(row: tuple[int, ...]) -> list[tuple[int, ...]]:
        for k in range(3):
            start, end, apex = row[k], row[(k + 1) % 3], row[(k + 2) % 3]
            steps = (end - start) % count
            if (start, end) in outer and steps > 1:
                chain = [(start + step) % count for step in range(steps + 1)]
                return [piece for pair in pairwise(chain) for piece in split((*pair, apex))]
        return [row]

    whole = [piece for row in triangles for piece in split(row)]
    return np.array(whole, np.int64) if len(whole) == count - 2 else None
