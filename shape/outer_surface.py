"""The faces that are on the surface of a solid, without those that other bodies cover.

Where closed bodies overlap, their union is the solid, and the faces inside it are not its surface: a distance to
them would be too short. Faces that are covered in part are split first. Frame: normalised.
"""

from __future__ import annotations

import numpy as np

from .solid_query import WindingQuery

OFFSET = 2.0e-3
"""How far outside a face is asked whether that is inside: bodies that touch within this (half a thousandth of
the size) hide each other's faces."""

COARSE = 0.15
"""Longest side of a triangle that a few points may judge."""

FINE = 0.04
"""Triangles that are covered in part are split down to this: the width of the error where bodies meet."""

CORNERS = np.array([[0.9, 0.05, 0.05], [0.05, 0.9, 0.05], [0.05, 0.05, 0.9], [1 / 3, 1 / 3, 1 / 3]])
"""Barycentric coordinates of the points that judge a triangle; a small one is judged by the last alone."""

TRIAL_COUNT = 400
"""Faces beside no other body that are tried before it is believed that bodies do not overlap themselves."""

MAX_BODIES = 3000
"""With more bodies than this, which of them may overlap is not asked: all may."""

PAIRS = 1 << 15
"""Pairs of a face and another body's box that are looked at together."""

MAX_PIECES = 60_000
"""Triangles under examination at most; with more, what is covered in part is decided as it is."""


def find_boundary(
    vertices: np.ndarray, faces: np.ndarray, body: np.ndarray, query: WindingQuery
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, faces, and the face that each came from, of the surface of what `faces` enclose.

    Args:
        vertices: (n, 3) float64, normalised. faces: (m, 3), counter-clockwise seen from outside.
        body: (m,) int, the body of each face.
        query: of the same faces.

    Returns:
        vertices (n', 3), of which the first n are the same; faces (k, 3); (k,) int, indices into `faces`. Where
        nothing overlaps they are `faces` themselves.
    """
    triangles = vertices[faces]
    asked = _beside_others(triangles, body)
    alone = np.flatnonzero(~asked)
    if len(alone):
        tried = alone[np.linspace(0, len(alone) - 1, min(TRIAL_COUNT, len(alone))).astype(np.int64)]
        if _covered(query, triangles[tried], CORNERS[3:]).any():
            asked[:] = True
    chosen = np.flatnonzero(asked)
    pieces, source, whole = _split_covered(query, triangles[chosen])
    everything = np.arange(len(faces))
    if whole.all():
        return vertices, faces, everything
    kept = np.delete(everything, chosen[~whole])
    fresh = np.arange(3 * len(source)).reshape(-1, 3) + len(vertices)
    return (
        np.concatenate([vertices, pieces.reshape(-1, 3)]),
        np.concatenate([faces[kept], fresh]),
        np.concatenate([kept, chosen[source]]),
    )


def _beside_others(triangles: np.ndarray, body: np.ndarray) -> np.ndarray:
    """Overlap of each triangle (m, 3, 3) with the bounding box of a body that is not its own; (m,) bool."""
    low, high = triangles.min(axis=1) - OFFSET, triangles.max(axis=1) + OFFSET
    label, body = np.unique(body, return_inverse=True)
    beside = np.zeros(len(triangles), bool)
    if len(label) > MAX_BODIES:
        return ~beside
    order = np.argsort(body, kind="stable")
    start = np.searchsorted(body[order], np.arange(len(label)))
    box_low, box_high = np.minimum.reduceat(low[order], start), np.maximum.reduceat(high[order], start)
    for index, members in enumerate(np.split(order, start[1:])):
        near = ((box_low <= box_high[index]) & (box_high >= box_low[index])).all(axis=1)
        near[index] = False
        others = np.flatnonzero(near)
        step = max(1, PAIRS // len(members))
        for first in range(0, len(others), step):
            some = others[first : first + step]
            rest = members[~beside[members]]
            if not len(rest):
                break
            reaches = (low[rest, None] <= box_high[some]) & (high[rest, None] >= box_low[some])
            beside[rest] = reaches.all(axis=2).any(axis=1)
    return beside


def _split_covered(query: WindingQuery, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Uncovered pieces (k, 3, 3) of faces covered in part, their faces (k,); (m,) bool, faces wholly uncovered."""
    whole = np.ones(len(triangles), bool)
    pending, owner = triangles, np.arange(len(triangles))
    pieces, piece_owner = [triangles[:0]], [owner[:0]]
    while len(pending):
        side = np.linalg.norm(np.roll(pending, -1, axis=1) - pending, axis=2)
        longest = side.max(axis=1)
        small = (longest <= FINE) | (len(pending) > MAX_PIECES)
        large = ~small & (longest > COARSE)
        votes = np.zeros((len(pending), 2), np.int64)
        for group, points in ((small, CORNERS[3:]), (~(small | large), CORNERS)):
            covered = _covered(query, pending[group], points)
            votes[group] = np.stack([covered.sum(axis=1), (~covered).sum(axis=1)], axis=1)
        mixed = large | (votes.min(axis=1) > 0)
        whole[owner[~mixed & (votes[:, 0] > 0)]] = False
        out = ~mixed & (votes[:, 0] == 0)
        pieces.append(pending[out])
        piece_owner.append(owner[out])
        pending, owner = _halve(pending[mixed], side[mixed].argmax(axis=1)), np.repeat(owner[mixed], 2)
    all_pieces, all_owner = np.concatenate(pieces), np.concatenate(piece_owner)
    partial = ~whole[all_owner]
    return all_pieces[partial], all_owner[partial], whole


def _halve(triangles: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Each triangle (n, 3, 3) as two, cut in the middle of a side (n,), from its first corner on; (2 n, 3, 3)."""
    row = np.arange(len(triangles))
    a, b, c = (triangles[row, (side + k) % 3] for k in range(3))
    middle = 0.5 * (a + b)
    return np.stack([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)], axis=1).reshape(
        -1, 3, 3
    )


def _covered(query: WindingQuery, triangles: np.ndarray, barycentric: np.ndarray) -> np.ndarray:
    """Containment in the solid just outside of triangles (n, 3, 3), at points (p, 3) of each; (n, p) bool."""
    if not len(triangles):
        return np.zeros((0, len(barycentric)), bool)
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normal = cross / np.maximum(np.linalg.norm(cross, axis=1), 1e-300)[:, None]
    points = np.einsum("pk,nkj->npj", barycentric, triangles) + (OFFSET * normal)[:, None]
    return query.contains(points.reshape(-1, 3)).reshape(len(triangles), -1)
