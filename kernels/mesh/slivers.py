"""Faces too thin for distances in float32: widened where a mesh consists of them, so that it can be measured at all."""

from __future__ import annotations

import numpy as np

SLIVER = 1e-6
"""Twice the area over the sum of the squared sides: below this, queries do not see a face, but for a point."""

INEXACT = 5e-5
"""Below this, the nearest point of a face may come out anywhere on its plane."""

WIDENED = 1e-3
"""Width given to a sliver, as a share of its length: distances to it are exact, and nobody sees how wide it is."""

LEAST = 1e-6
"""Width that rounding to float32 leaves, in [-1, 1]^3."""

LOOKED_AT = 1000
"""Faces that are looked at first: nearly every mesh has few slivers among them."""


def seen_faces(vertices: np.ndarray, faces: np.ndarray, limit: float = SLIVER) -> np.ndarray:
    """Mask of the faces (m, 3) of vertices (n, 3) that queries see; (m,) bool."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    squares = sum(((q - p) ** 2).sum(axis=1) for p, q in ((a, b), (a, c), (b, c)))
    return ~(np.linalg.norm(np.cross(b - a, c - a), axis=1) < limit * squares)


def widen_slivers(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same mesh, or one whose slivers are a little wider if they have the most of its area.

    Among other faces slivers are left as they are: their neighbours are where they are.

    Args:
        vertices: (n, 3) float32, inside [-1, 1]^3. faces: (m, 3) int32, m > 0.

    Returns:
        vertices (k, 3) float32, faces (m, 3) int32, in the same order.
    """
    some = faces[:: -(-len(faces) // LOOKED_AT)]
    if 2 * np.count_nonzero(seen_faces(vertices, some, INEXACT)) >= len(some):
        return vertices, faces
    exact = seen_faces(vertices, faces, INEXACT)
    corners = vertices[faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    if 2.0 * area[exact].sum() >= area.sum() > 0.0:
        return vertices, faces
    thin = corners[~exact]
    row = np.arange(len(thin))
    longest = np.linalg.norm(np.roll(thin, -1, axis=1) - thin, axis=2).argmax(axis=1)
    start, end, tip = (thin[row, (longest + k) % 3] for k in range(3))
    along = end - start
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along /= np.maximum(length, 1e-30)
    foot = start + ((tip - start) * along).sum(axis=1, keepdims=True) * along
    across = tip - foot
    # A tip on the longest side goes towards the axis to which that is steepest.
    axis = np.eye(3)[np.abs(along).argmin(axis=1)]
    upright = axis - (axis * along).sum(axis=1, keepdims=True) * along
    height = np.linalg.norm(across, axis=1, keepdims=True)
    across = np.where(height > 0.1 * LEAST, across, upright)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    wide = np.stack([start, end, foot + np.maximum(WIDENED * length, LEAST) * across], axis=1)
    corners[~exact] = np.stack([wide[row, (k - longest) % 3] for k in range(3)], axis=1)
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * len(faces), dtype=np.int32).reshape(-1, 3)
