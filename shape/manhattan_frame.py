"""The Manhattan frame of a mesh: three orthogonal axes along which most of its faces look (Straub et al. 2014).

What is made by machines or drawn with them has faces along three axes, wherever the file has turned it. A fit whose
grid is turned with it finds slabs, holes and boxes there as it finds them in a mesh that stands straight.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

CANDIDATES = 24
"""Directions that are tried: those that most area looks along, no two alike."""

CROSSED = 4
"""Of which each two give another one, across both."""

BINS = 28
"""Cells along a unit of a normal's components, about two degrees each, in which area is summed up."""

ALIKE = np.cos(np.radians(2.0))
"""Directions closer than this are one."""

PARALLEL, PERPENDICULAR = np.cos(np.radians(1.0)), np.sin(np.radians(1.0))
"""From here a normal is along an axis, and below here across it."""

LEAST_SHARE = 0.5
"""Share of the area that must be along the first axis or across it."""

LEAST_GAIN = 0.2
"""Share of the area by which a frame must be better than the axes that are there."""


def manhattan_frame(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray | None:
    """The rotation that stands a mesh straight.

    Args:
        vertices: (n, 3).
        faces: (m, 3).

    Returns:
        (3, 3) float64, its rows are the mesh's own axes: `rotation @ point` stands straight. None for a mesh that has
        no such axes, or stands straight already.
    """
    normal, area = _normals(vertices, faces)
    total = float(area.sum())
    if not total > 0.0:
        return None
    directions = _candidates(normal, area)
    along = np.abs(normal @ directions.T)
    share = area @ ((along > PARALLEL) | (along < PERPENDICULAR)) / total
    first = int(np.argmax(share.round(3)))
    if share[first] < LEAST_SHARE:
        return None
    frame = _nearest_frame(_complete(directions, first, area @ (along > PARALLEL)))
    gain = _share_along(normal, area, frame) - _share_along(normal, area, np.eye(3))
    return frame if gain > LEAST_GAIN * total else None


def _normals(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals (m, 3) and areas (m,) of the faces that have one."""
    a, b, c = (vertices[faces[:, k]].astype(np.float64) for k in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    kept = length > 0.0
    return normal[kept] / length[kept, None], 0.5 * length[kept]


def _candidates(normal: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Directions (k, 3): those that most area looks along, no two alike, and what is across two of the first."""
    # Opposite faces have one axis: its largest component is made positive.
    largest = np.take_along_axis(normal, np.abs(normal).argmax(axis=1)[:, None], axis=1)
    axis = np.where(largest < 0.0, -normal, normal)
    _, label = np.unique((axis * BINS).round().astype(np.int64), axis=0, return_inverse=True)
    label = label.reshape(-1)
    weight = np.bincount(label, area)
    found = np.zeros((0, 3))
    largest_face = np.zeros(len(weight), np.int64)
    order = np.argsort(area, kind="stable")
    largest_face[label[order]] = order
    left = np.argsort(-weight, kind="stable")
    while len(left) and len(found) < CANDIDATES:
        found = np.concatenate([found, axis[largest_face[left[:1]]]])
        left = left[np.abs(axis[largest_face[left]] @ found[-1]) < ALIKE]
    # A rod has no faces along its axis to speak of, but many across it.
    across = [np.cross(one, two) for one, two in combinations(found[:CROSSED], 2)]
    across = [direction / np.linalg.norm(direction) for direction in across]
    return np.concatenate([found, np.reshape(across, (-1, 3))])


def _complete(directions: np.ndarray, first: int, parallel: np.ndarray) -> np.ndarray:
    """Orthonormal rows (3, 3): the first direction, the largest across it if any, and theirs."""
    one = directions[first]
    across = np.abs(directions @ one) < PERPENDICULAR
    if across.any():
        two = directions[int(np.argmax(np.where(across, parallel, -1.0)))]
    else:
        # Anything will do, so what turns least: the grid's axis that is most across.
        two = np.eye(3)[int(np.argmin(np.abs(one)))]
    two = two - (two @ one) * one
    two /= np.linalg.norm(two)
    return np.stack([one, two, np.cross(one, two)])


def _nearest_frame(axes: np.ndarray) -> np.ndarray:
    """The rows in the order and with the signs that make the smallest rotation of them."""
    order = []
    for grid_axis in range(3):
        free = [k for k in range(3) if k not in order]
        order.append(max(free, key=lambda k: abs(axes[k, grid_axis])))
    frame = axes[order]
    frame *= np.where(np.diagonal(frame) < 0.0, -1.0, 1.0)[:, None]
    if np.linalg.det(frame) < 0.0:
        frame[int(np.argmin(np.abs(np.diagonal(frame))))] *= -1.0
    return frame


def _share_along(normal: np.ndarray, area: np.ndarray, frame: np.ndarray) -> float:
    """Area along or across the axis of a frame that has most of it, plus that along any of its axes; halved."""
    along = np.abs(normal @ frame.T)
    best = (area @ ((along > PARALLEL) | (along < PERPENDICULAR))).max()
    return 0.5 * float(best + area @ (along > PARALLEL).any(axis=1))
