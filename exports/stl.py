"""Binary STL: one surface of the smooth union, unless told otherwise."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..assembly.atomic_write import write_bytes
from .exporter import Exporter
from .mesh import Surface, joined, surfaces

if TYPE_CHECKING:
    from ..assembly.assembly import Assembly


def write_stl(
    assembly: Assembly,
    path: Path,
    *,
    merged: bool = True,
    resolution: int | None = None,
    device: str = "auto",
) -> None:
    """Write .stl; the options are those of `surfaces`.

    Raises:
        InputError: if the resolution is impossible, the format cannot hold the surface, or the file cannot be written.
    """
    write_bytes(path, stl_bytes(surfaces(assembly, path, merged, resolution, device, np.float32)))


def stl_bytes(surfaces: list[Surface]) -> bytes:
    """Binary STL. The format has float32 coordinates only: meshes far from the origin lose detail."""
    whole = joined(surfaces)
    triangles = np.zeros(
        len(whole.faces), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")]
    )
    corners = whole.vertices[whole.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    triangles["normal"] = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)
    triangles["corners"] = corners
    return b"resfit".ljust(80) + len(triangles).to_bytes(4, "little") + triangles.tobytes()


EXPORTER = Exporter((".stl",), write_stl)
