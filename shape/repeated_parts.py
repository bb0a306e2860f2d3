"""Congruent parts of a mesh, the same part in another place: wheels, bolts, spokes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial import KDTree

from .parts import Piece

SAME = 2e-3
"""Largest distance between matching vertices, as a share of the part's radius: single-precision files and modelling
tools that place copies by rounded angles stay below it, and no fit is as exact."""

SAME_SHAPE = 1e-3
"""Largest relative difference of the numbers that are compared first."""

DISTINCT = 0.02
"""Principal moments that differ by less, relatively, do not tell one axis from another."""

MOST_VERTICES = 4000
"""Vertices that are matched at most: spread over larger parts."""


@dataclass(frozen=True)
class Copy:
    """Rigid transform to a part from an earlier one: p = turn @ q + shift, in the frame of the whole."""

    source: int
    """Index of the earlier part, itself no copy."""
    turn: np.ndarray
    """(3, 3) orthogonal; a reflection has determinant -1."""
    shift: np.ndarray
    """(3,)"""


@dataclass(frozen=True)
class _Shape:
    """A part as it is compared."""

    counts: tuple[int, ...]
    middles: np.ndarray
    """(m, 3) float64, face middles in the order of the faces."""
    vertices: np.ndarray
    centre: np.ndarray
    radii: np.ndarray
    """Sorted distances of the vertices from their centre."""
    moments: np.ndarray
    axes: np.ndarray
    """(3, 3), columns are the principal axes, ascending moments."""


def find_copies(pieces: list[Piece]) -> list[Copy | None]:
    """For each part what it is a copy of, None for those that are the first of their kind.

    Only parts with as many vertices and faces are compared: modelled copies are, scanned twins are not.
    """
    shapes = [_describe(piece) for piece in pieces]
    originals: list[int] = []
    found: list[Copy | None] = []
    for index, shape in enumerate(shapes):
        copy = None
        for source in originals:
            motion = _motion(shapes[source], shape)
            if motion is not None:
                copy = Copy(source, *motion)
                break
        if copy is None:
            originals.append(index)
        found.append(copy)
    return found


def _describe(piece: Piece) -> _Shape:
    faces = np.concatenate([piece.winding_faces, piece.sheet_faces])
    vertices = piece.vertices.astype(np.float64)
    centre = vertices.mean(axis=0)
    moments, axes = np.linalg.eigh(np.cov((vertices - centre).T, bias=True))
    radii = np.sort(np.linalg.norm(vertices - centre, axis=1))
    counts = (len(vertices), len(piece.winding_faces), len(piece.sheet_faces))
    return _Shape(counts, vertices[faces].mean(axis=1), vertices, centre, radii, moments, axes)


def _motion(source: _Shape, shape: _Shape) -> tuple[np.ndarray, np.ndarray] | None:
    """Turn and shift that take one part to the other, None if none does."""
    size = source.radii[-1]
    if source.counts != shape.counts or np.abs(source.radii - shape.radii).max() > SAME_SHAPE * size:
        return None
    if np.abs(source.moments - shape.moments).max() > SAME_SHAPE * size * size:
        return None
    tree = KDTree(shape.vertices)
    step = -(-len(source.vertices) // MOST_VERTICES)
    for turn in _turns(source, shape):
        moved = (source.vertices - source.centre) @ turn.T + shape.centre
        distance = tree.query(moved[::step], distance_upper_bound=2.0 * SAME * size)[0]
        if distance.max() <= SAME * size:
            return turn, shape.centre - turn @ source.centre
    return None


def _turns(source: _Shape, shape: _Shape) -> list[np.ndarray]:
    """Orthogonal matrices that may take one part to the other: proper ones first.

    A copied part mostly keeps the order of its faces: then the best fit of their middles is the one. Else its
    principal axes tell, where they differ.
    """
    a, b = source.middles - source.middles.mean(axis=0), shape.middles - shape.middles.mean(axis=0)
    left, _, right = np.linalg.svd(b.T @ a)
    turns = [left @ np.diag([1.0, 1.0, sign]) @ right for sign in (np.linalg.det(left @ right), 1.0)]
    if (np.diff(source.moments) > DISTINCT * source.moments[-1]).all():
        signs = [np.diag(signs) for signs in product((1.0, -1.0), repeat=3)]
        turns += sorted(
            (shape.axes @ flips @ source.axes.T for flips in signs), key=lambda turn: -np.linalg.det(turn)
        )
    # Copies along an axis or turned by quarters are meant to be exact.
    whole = [np.round(turn) for turn in turns]
    return [
        near if np.abs(turn - near).max() < 1e-4 else turn for turn, near in zip(turns, whole, strict=True)
    ]
