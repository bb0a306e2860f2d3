"""Closing the holes of patches that bound a solid, so that distances know where the surface would be."""

from __future__ import annotations

import numpy as np
import warp as wp

from .patches import PROBE_OFFSET, wind
from .topology import connected_labels, find_edges

RIM_SHARE = 0.7
"""A cap is kept if so many of its triangles lie where the surface is missing: where half the winding is."""

RIM_WINDING = 0.3
"""How far from 1/2, beyond whole numbers, the winding number may be there. Where a cap would cut through the
inside, as between the panels of a body, it is a whole number."""


PROBE_SHARE = 0.1
"""How far beside a triangle of a cap is asked at most, in lengths of its size: a small hole's winding changes fast."""


def cap_holes(
    vertices: np.ndarray, faces: np.ndarray, patch: np.ndarray, device: wp.Device
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Fans over the holes of a mesh.

    Each hole is closed by triangles from its rim to the rim's middle.

    Args:
        vertices: (n, 3) float64, normalised. faces: (m, 3), all that wind. patch: (m,), of each face.
        device: where to compute.

    Returns:
        vertices with the middles appended; the fans' faces (k, 3), the patches (k,) that they close, and the
        number of holes that were left.
    """
    edges = find_edges(faces)
    # Rims are those of patches: bodies that touch in an edge do not close each other's holes.
    key = patch[:, None] * np.int64(edges.count) + edges.side_edge
    _, inverse = np.unique(key, return_inverse=True)
    inverse = inverse.reshape(-1, 3)
    sums = np.bincount(inverse.ravel(), edges.side_direction.ravel())
    face, side = np.nonzero((sums[inverse] != 0) & (sums[inverse] * edges.side_direction > 0))
    if not len(face):
        return vertices, np.zeros((0, 3), np.int64), np.zeros(0, np.int64), 0
    start, end, owner = faces[face, side], faces[face, (side + 1) % 3], patch[face]
    rim = _label_rims(start, end, owner)
    count = int(rim.max()) + 1
    weight = np.bincount(rim, minlength=count)
    middle = np.stack([np.bincount(rim, vertices[start, axis], count) / weight for axis in range(3)], axis=1)
    fans = np.stack([end, start, len(vertices) + rim], axis=1)
    capped = np.concatenate([vertices, middle])
    corners = capped[fans]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    height = np.minimum(PROBE_OFFSET, PROBE_SHARE * np.sqrt(length)) / np.maximum(length, 1e-300)
    offset = height[:, None] * cross
    # On both sides: a cap that lies on the patch itself, as a flat patch's does, has half the winding on it, but
    # not beside it.
    sides = np.concatenate([corners.mean(axis=1) + offset, corners.mean(axis=1) - offset])
    winding = wind(vertices, faces, sides, device)
    beside = (np.abs(winding - np.floor(winding) - 0.5) < RIM_WINDING).reshape(2, -1).all(axis=0)
    kept = np.bincount(rim, beside, count) >= RIM_SHARE * weight
    return capped, fans[kept[rim]], owner[kept[rim]], int((~kept).sum())


def _label_rims(start: np.ndarray, end: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Number of the hole that each rim edge start - end of a patch `owner` belongs to."""
    size = int(max(start.max(), end.max())) + 1
    keys, node = np.unique(
        np.concatenate([owner * np.int64(size) + start, owner * np.int64(size) + end]), return_inverse=True
    )
    label = connected_labels(node[: len(start)], node[len(start) :], len(keys))
    return np.unique(label[node[: len(start)]], return_inverse=True)[1]
