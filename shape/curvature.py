"""Curvature of a surface: the larger absolute principal curvature, per face, and its creases.

Frame: normalised, so that curvatures are in 1 / normalised units: a ball of radius 0.05 has 20.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .topology import adjacent_faces, connected_labels, find_edges

if TYPE_CHECKING:
    from scipy.spatial import KDTree

MAX_CURVATURE = 20.0
"""Curvatures are clamped to this; creases, and whatever is near them, have it."""

CREASE_ANGLE = np.radians(40.0)
"""Faces that meet at a larger angle make a crease; a smaller one is a facet of something round (a cylinder
drawn with ten sides turns by 36 degrees)."""

CREASE_REACH = 0.5 / MAX_CURVATURE
"""Distance from a crease up to which the surface counts as part of it: half the radius of an edge rounded to
MAX_CURVATURE."""

MAX_CREASE_POINTS = 200_000
"""Points put on creases at most; they lie CREASE_REACH apart unless that takes more."""


@dataclass(frozen=True)
class Curvature:
    """The curvature of a mesh of m faces, ready to be asked for at points on it."""

    face: np.ndarray
    """(m,) float32, of each face away from creases, 0 to MAX_CURVATURE."""
    creases: KDTree | None
    """Points along the creases; None if there are none."""

    def at(self, points: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """Curvature (n,) float32 at points (n, 3) on the surface, normalised, that lie in `faces` (n,)."""
        value = self.face[faces]
        if self.creases is not None and len(points):
            distance = self.creases.query(points, distance_upper_bound=CREASE_REACH)[0]
            value = np.where(np.isfinite(distance), np.float32(MAX_CURVATURE), value)
        return value


def weight_of(curvature: np.ndarray) -> np.ndarray:
    """Weight 1 + sigmoid(curvature) of a sample, (n,) float32: 1.5 on flat surfaces, 2 at creases."""
    return (1.0 + 1.0 / (1.0 + np.exp(-curvature))).astype(np.float32)


def measure_curvature(vertices: np.ndarray, faces: np.ndarray) -> Curvature:
    """The curvature of vertices (n, 3), normalised, and faces (m, 3).

    Normals of the corners are averaged around each vertex, but not across creases; their change along the sides
    of a face gives its second fundamental form (Rusinkiewicz, "Estimating curvatures and their derivatives on
    triangle meshes", 2004).
    """
    corners = vertices[faces].astype(np.float64)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    normal = cross / np.maximum(length, 1e-300)[:, None]
    edges = find_edges(faces)
    first, second, edge = adjacent_faces(edges)
    cosine = np.einsum("ij,ij->i", normal[first], normal[second])
    solid = (length[first] > 0.0) & (length[second] > 0.0)
    sharp = solid & (cosine < np.cos(CREASE_ANGLE))
    corner_normal = _corner_normals(faces, corners, normal, first[~sharp], second[~sharp])
    face = _largest_curvature(corners, normal, corner_normal)
    # Where three or more faces meet there is no smooth surface either.
    crease = np.concatenate([edge[sharp], np.flatnonzero(edges.face_count > 2)])
    return Curvature(face, _crease_points(vertices, faces, edges.side_edge, crease))


def _corner_normals(
    faces: np.ndarray, corners: np.ndarray, normal: np.ndarray, first: np.ndarray, second: np.ndarray
) -> np.ndarray:
    """Unit normal of each corner (m, 3, 3): the mean, by angle, over the faces round its vertex that smooth edges
    join."""
    shared = faces[first][:, :, None] == faces[second][:, None, :]
    pair, here, there = np.nonzero(shared)
    rows, columns = 3 * first[pair] + here, 3 * second[pair] + there
    group = connected_labels(rows, columns, faces.size)
    ahead = np.roll(corners, -1, axis=1) - corners
    behind = np.roll(corners, 1, axis=1) - corners
    sine = np.linalg.norm(np.cross(ahead, behind), axis=2)
    angle = np.arctan2(sine, np.einsum("fkj,fkj->fk", ahead, behind))
    weighted = (angle[:, :, None] * normal[:, None, :]).reshape(-1, 3)
    total = np.stack([np.bincount(group, weighted[:, axis]) for axis in range(3)], axis=1)
    total /= np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None]
    return total[group].reshape(-1, 3, 3)


def _largest_curvature(corners: np.ndarray, normal: np.ndarray, corner_normal: np.ndarray) -> np.ndarray:
    """Larger absolute eigenvalue of each face's second fundamental form, (m,) float32."""
    side = np.roll(corners, -1, axis=1) - corners
    change = np.roll(corner_normal, -1, axis=1) - corner_normal
    length = np.linalg.norm(side[:, 0], axis=1)
    x = side[:, 0] / np.maximum(length, 1e-300)[:, None]
    y = np.cross(normal, x)
    u, v = np.einsum("fkj,fj->fk", side, x), np.einsum("fkj,fj->fk", side, y)
    p, q = np.einsum("fkj,fj->fk", change, x), np.einsum("fkj,fj->fk", change, y)
    # Least squares for the symmetric [[a, b], [b, c]] that takes (u, v) to (p, q) on all three sides.
    uu, uv, vv = (u * u).sum(1), (u * v).sum(1), (v * v).sum(1)
    scale = np.maximum(uu + vv, 1e-300)
    matrix = np.zeros((len(u), 3, 3))
    matrix[:, 0, 0], matrix[:, 1, 1], matrix[:, 2, 2] = uu, uu + vv, vv
    matrix[:, 0, 1] = matrix[:, 1, 0] = matrix[:, 1, 2] = matrix[:, 2, 1] = uv
    # A sliver says nothing about the direction across it: lean that towards 0.
    matrix += (1e-6 * scale)[:, None, None] * np.eye(3)
    matrix[scale <= 1e-30] = np.eye(3)
    right = np.stack([(u * p).sum(1), (u * q + v * p).sum(1), (v * q).sum(1)], axis=1)
    a, b, c = np.linalg.solve(matrix, right[:, :, None])[:, :, 0].T
    largest = np.abs(0.5 * (a + c)) + np.sqrt(0.25 * (a - c) ** 2 + b * b)
    return np.nan_to_num(np.clip(largest, 0.0, MAX_CURVATURE), nan=0.0).astype(np.float32)


def _crease_points(
    vertices: np.ndarray, faces: np.ndarray, side_edge: np.ndarray, crease: np.ndarray
) -> KDTree | None:
    if not len(crease):
        return None
    # Loaded in the background since the mesh was read.
    from scipy.spatial import KDTree

    side = np.zeros(int(side_edge.max()) + 1, np.int64)
    side[side_edge.ravel()] = np.arange(side_edge.size)
    side = side[crease]
    start = vertices[faces[side // 3, side % 3]].astype(np.float64)
    end = vertices[faces[side // 3, (side % 3 + 1) % 3]].astype(np.float64)
    length = np.linalg.norm(end - start, axis=1)
    spacing = max(CREASE_REACH, float(length.sum()) / MAX_CREASE_POINTS)
    count = np.maximum(1, np.ceil(length / spacing)).astype(np.int64)
    which = np.repeat(np.arange(len(side)), count)
    step = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    share = ((step + 0.5) / count[which])[:, None]
    return KDTree(start[which] * (1.0 - share) + end[which] * share)
