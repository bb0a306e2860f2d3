"""Welding vertices that lie on each other, and dropping faces that say nothing."""

from __future__ import annotations

import numpy as np

from resfit.errors import InputError

WELD_STEPS = 1 << 20
"""Vertices in the same cell of a grid with this many cells along the longest side become one: a millionth of
the size is above the rounding of float32 files, and below any feature."""

LEAST_WIDTH = 1.5e-7
"""Width of a face, by the longest side of the mesh, that is left of it in float32."""

BLOCK = 1 << 17
"""Faces that are looked at together."""

SMALLEST = 1e-280
"""Of the longest side: below, its inverse and squares of its parts are no longer numbers."""


def weld_vertices(
    vertices: np.ndarray, faces: np.ndarray, name: str = "the mesh"
) -> tuple[np.ndarray, np.ndarray]:
    """Merge vertices that coincide; of several, the first keeps its exact position.

    Args:
        vertices: (n, 3) float64, mesh units; those used by faces finite. faces: (m, 3) int.
        name: what messages call the mesh.

    Returns:
        vertices (k, 3) float64, sorted by position; faces (m, 3) int64.

    Raises:
        InputError: if all vertices are at one place, too near to each other or too far apart for float64.
    """
    used = np.unique(faces)
    lower, upper = vertices[used].min(axis=0), vertices[used].max(axis=0)
    # Halves first: the difference of two large numbers may overflow.
    side = float((upper / 2 - lower / 2).max()) * 2.0
    if not np.isfinite(side):
        raise InputError(
            f"the bounding box of {name} is too large for floating-point numbers; scale it down."
        )
    if side <= 0.0:
        raise InputError(f"all vertices of {name} are at one place: there is no shape in it.")
    if side < SMALLEST:
        raise InputError(f"the bounding box of {name} is too small for floating-point numbers; scale it up.")
    # Relative to the lower corner and the size, so that neither offset nor scale matters.
    # In place: of a large scan each copy is as large as the file.
    cells = vertices[used] - lower
    cells *= WELD_STEPS / side
    x, y, z = np.round(cells, out=cells).T
    key = (x.astype(np.int64) << 42) | (y.astype(np.int64) << 21) | z.astype(np.int64)
    del cells, x, y, z
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    renumber = np.zeros(len(vertices), np.int64)
    renumber[used] = inverse
    return vertices[used[first]], renumber[faces]


def clean_faces(faces: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Find the faces to keep: those with three different corners, and of equal ones the first.

    A thin triangle with three different corners in one line stays: without it its neighbours would no longer
    meet. Two faces with the same corners but turned against each other both stay, too: they may be the two
    sides of a sheet, or a wall between two bodies, which `solid` tells apart.

    Args:
        faces: (m, 3) int.

    Returns:
        indices of the faces kept, ascending, (k,) int64; sentences about what was dropped.
    """
    a, b, c = faces.T
    whole = np.flatnonzero((a != b) & (b != c) & (c != a))
    # Turned so that the smallest corner comes first, equal faces are equal rows.
    lead = np.argmin(faces[whole], axis=1)
    rows = np.arange(len(whole))
    turned = [faces[whole][rows, (lead + k) % 3] for k in range(3)]
    order = np.lexsort((turned[2], turned[1], turned[0]))
    new = np.ones(len(whole), bool)
    if len(whole) > 1:
        new[1:] = np.logical_or.reduce([np.diff(column[order]) != 0 for column in turned])
    kept = np.sort(whole[order[new]])
    notes = []
    if len(whole) < len(faces):
        notes.append(_dropped(len(faces) - len(whole), "{} without area"))
    if len(kept) < len(whole):
        notes.append(_dropped(len(whole) - len(kept), "repeated {}"))
    return kept, notes


def _dropped(count: int, what: str) -> str:
    noun, verb = ("face", "was") if count == 1 else ("faces", "were")
    return f"{count} {what.format(noun)} {verb} dropped."


def has_area(vertices: np.ndarray, faces: np.ndarray, least: float = 0.0) -> bool:
    """True if any triangle, across its longest side, is wider than `least`, the mesh scaled to size 1."""
    low = vertices.min(axis=0)
    side = max(float((vertices.max(axis=0) - low).max()), SMALLEST)
    for first in range(0, len(faces), BLOCK):
        corners = (vertices[faces[first : first + BLOCK]] - low) / side
        longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
        doubled = np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        if (doubled > least * longest).any():
            return True
    return False


def face_areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Areas (m,) float64 of the triangles, in squared units of `vertices`; infinite where float64 ends."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    with np.errstate(over="ignore", invalid="ignore"):
        areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    areas[np.isnan(areas)] = np.inf
    return areas
