"""The mesh that a page shows over the assembly: few faces, and few bytes."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

if TYPE_CHECKING:
    from ..assembly.assembly import Assembly

MAX_FACES = 4000
"""Faces of the mesh that is shown: it is there for comparison, not for its detail."""

MAX_QUADRIC_FACES = 16000
"""More are first merged in cells, in a few milliseconds, so that a fit does not wait for its page."""

CELLS = 160
"""Cells along the longest side in which vertices are merged at first: finer than a screen shows."""


class Surface(Protocol):
    """Mesh protocol: vertices (n, 3) and triangles (m, 3); a trimesh, or what was loaded from a file."""

    @property
    def vertices(self) -> Any: ...
    @property
    def faces(self) -> Any: ...


class Triangles(NamedTuple):
    """The least that is a `Surface`."""

    vertices: np.ndarray
    faces: np.ndarray


def mesh_table(mesh: Surface, assembly: Assembly) -> dict[str, Any] | None:
    """A mesh of at most MAX_FACES faces in the normalised frame, as 16-bit numbers in base64; None if it has none."""
    vertices = (
        np.asarray(mesh.vertices) - np.asarray(assembly.transform.translation)
    ) / assembly.transform.scale
    vertices, faces = simplified(vertices, np.asarray(mesh.faces, np.int64))
    if not len(faces):
        return None
    low = vertices.min(axis=0)
    size = np.maximum(vertices.max(axis=0) - low, 1e-9)
    steps = np.round((vertices - low) / size * 65535.0).astype("<u2")
    return {
        "low": low.tolist(),
        "size": size.tolist(),
        "vertices": base64.b64encode(steps.tobytes()).decode(),
        "faces": base64.b64encode(faces.astype("<u2").tobytes()).decode(),
    }


def simplified(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """At most MAX_FACES faces (m, 3), and their vertices (n, 3).

    Edges are collapsed by what it costs in distance. That cannot lessen the number of bodies, and crawls where there
    are thousands of them; so vertices are merged in cells before, and after it if there are still too many faces.
    """
    import fast_simplification

    points, kept, cells = vertices, faces, CELLS
    while len(kept) > MAX_QUADRIC_FACES:
        points, kept = merged(vertices, faces, cells)
        cells = int(cells * 0.7)
    if len(kept) > MAX_FACES:
        found = fast_simplification.simplify(points, kept.astype(np.int32), target_count=MAX_FACES)
        points, kept = found[0], found[1].astype(np.int64)
    while len(kept) > MAX_FACES:
        points, kept = merged(vertices, faces, cells)
        cells = int(cells * 0.7)
    used, renumbered = np.unique(kept, return_inverse=True)
    return points[used], renumbered.reshape(-1, 3)


def merged(vertices: np.ndarray, faces: np.ndarray, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """The mesh with all vertices of a cell at their mean, and no face twice or without area."""
    low = vertices.min(axis=0)
    longest = max(float(np.ptp(vertices, axis=0).max()), 1e-30)
    index = np.minimum(((vertices - low) / longest * cells).astype(np.int64), cells - 1)
    # One number a cell: rows of three would take ten times as long to sort.
    _, group = np.unique((index[:, 0] * cells + index[:, 1]) * cells + index[:, 2], return_inverse=True)
    count = np.bincount(group)
    points = np.stack([np.bincount(group, column) for column in vertices.T], 1) / count[:, None]
    kept = group[faces]
    kept = kept[(kept[:, 0] != kept[:, 1]) & (kept[:, 1] != kept[:, 2]) & (kept[:, 0] != kept[:, 2])]
    corners = np.sort(kept, axis=1)
    _, first = np.unique(
        (corners[:, 0] * len(points) + corners[:, 1]) * len(points) + corners[:, 2], return_index=True
    )
    return points, kept[np.sort(first)]
