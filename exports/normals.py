"""Normals at the vertices of a mesh, for formats that store them.

They are trimesh's, without loading it: a fit has its mesh read by another process, and needs it for nothing else.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

NO_LENGTH = 2.2e-14
"""Vectors shorter than this have no direction: rounding made them."""

NO_ANGLE = 1e-8
"""A triangle with a smaller angle says nothing about the surface."""


def vertex_normals(
    vertices: npt.NDArray[np.float64], faces: npt.NDArray[np.int64]
) -> npt.NDArray[np.float64]:
    """Unit normals (v, 3) of vertices (v, 3): the mean over the faces (f, 3) around each, by their angles there.

    0 where no face with a direction uses a vertex (Thuermer and Wuethrich, "Computing vertex normals from polygonal
    facets", 1998).
    """
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    normal = unit(np.cross(b - a, c - b))
    u, v, w = unit(b - a), unit(c - a), unit(c - b)
    angle = np.empty((len(faces), 3))
    angle[:, 0] = np.arccos(np.clip(dot(u, v), -1.0, 1.0))
    angle[:, 1] = np.arccos(np.clip(dot(-u, w), -1.0, 1.0))
    angle[:, 2] = np.pi - angle[:, 0] - angle[:, 1]
    angle[(angle < NO_ANGLE).any(axis=1) | (dot(normal, normal) < 0.5)] = 0.0
    weighted = (angle[:, :, None] * normal[:, None, :]).reshape(-1, 3)
    place = faces.ravel()
    sums = [np.bincount(place, column, len(vertices)) for column in weighted.T]
    return unit(np.stack(sums, axis=1).astype(np.float64, copy=False))


def dot(a: npt.NDArray[np.float64], b: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Scalar products (n,) of vectors (n, 3)."""
    x, y, z = (a * b).T
    return x + y + z


def unit(vectors: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Vectors (n, 3) of length 1; those without a length nearly as they are."""
    length = np.sqrt(dot(vectors, vectors))
    return vectors * (1.0 / np.where(length > NO_LENGTH, length, 1.0))[:, None]
