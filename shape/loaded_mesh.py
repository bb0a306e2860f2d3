"""A loaded mesh: welded triangles in the mesh's own frame and unit, and the nodes of the scene that they are of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Part:
    """One node of a scene, or the whole of a file without nodes."""

    name: str
    first_face: int
    face_count: int
    """Its faces are those from `first_face` to `first_face + face_count` of the loaded mesh."""


@dataclass(frozen=True)
class LoadedMesh:
    """A triangle mesh as it was found, welded and without faces that say nothing."""

    vertices: npt.NDArray[np.float64]
    """(n, 3), mesh units; each is used by a face."""
    faces: npt.NDArray[np.int64]
    """(m, 3), m > 0, in the order of the input."""
    parts: tuple[Part, ...]
    sha256: str
    """Of the file's bytes; of vertices and faces, if the mesh came as an object."""
    notes: tuple[str, ...]
    """Sentences about what was changed."""
    reader: str = ""
    """What read the file, with its version."""
