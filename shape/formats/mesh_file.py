"""Contents of a mesh file, as a reader returns them: named pieces, in the file's own frame and unit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Piece:
    """One node, object or group of a file, its transform applied."""

    name: str
    """As the file has it; `mesh` where the file has no names."""
    vertices: npt.NDArray[np.float64]
    """(n, 3), the file's frame and unit; may hold vertices that no face uses."""
    faces: npt.NDArray[np.int64]
    """(m, 3) indices into `vertices`, counter-clockwise from outside; m may be 0. Not checked against n."""


@dataclass(frozen=True)
class MeshFile:
    """The content of a mesh file."""

    pieces: tuple[Piece, ...]
    """In the order of the file."""
    reader: str
    """What read it, as report.json says it: `resfit`, `trimesh 5.2.0`, `lib3mf 2.5.0`."""
    points: int = 0
    """Points that belong to no face: of point clouds, and points among the primitives."""
    lines: int = 0
    """Line segments or curves; they are left out."""
    notes: tuple[str, ...] = ()
    """Sentences about what was left out or taken otherwise than the file says."""
    unit: str = ""
    """What one unit of the coordinates is, where the format says so: m, mm, cm, um, in, ft; else empty."""
