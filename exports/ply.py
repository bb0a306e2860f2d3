"""Binary PLY: one surface of the smooth union, unless told otherwise."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..assembly.atomic_write import write_bytes
from .exporter import Exporter
from .mesh import Surface, joined, surfaces

if TYPE_CHECKING:
    from ..assembly.assembly import Assembly


def write_ply(
    assembly: Assembly,
    path: Path,
    *,
    merged: bool = True,
    resolution: int | None = None,
    device: str = "auto",
) -> None:
    """Write .ply; the options are those of `surfaces`.

    Raises:
        InputError: if the resolution is impossible, the format cannot hold the surface, or the file cannot be written.
    """
    write_bytes(path, ply_bytes(surfaces(assembly, path, merged, resolution, device)))


def ply_bytes(surfaces: list[Surface]) -> bytes:
    """Binary PLY with colours; coordinates are doubles, so that meshes far from the origin keep their form."""
    whole = joined(surfaces)
    vertices = np.zeros(len(whole.vertices), [("position", "<f8", 3), ("color", "u1", 3)])
    vertices["position"], vertices["color"] = whole.vertices, whole.colors
    faces = np.zeros(len(whole.faces), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, whole.faces
    header = ["ply", "format binary_little_endian 1.0", "comment resfit", f"element vertex {len(vertices)}"]
    header += [f"property double {axis}" for axis in "xyz"]
    header += [f"property uchar {channel}" for channel in ("red", "green", "blue")]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    return ("\n".join(header) + "\n").encode() + vertices.tobytes() + faces.tobytes()


EXPORTER = Exporter((".ply",), write_ply)
