"""Wavefront OBJ: one named object a part."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..assembly.atomic_write import write_bytes
from .exporter import Exporter
from .mesh import Surface, joined, surfaces

if TYPE_CHECKING:
    from ..assembly.assembly import Assembly


def write_obj(
    assembly: Assembly,
    path: Path,
    *,
    merged: bool = False,
    resolution: int | None = None,
    device: str = "auto",
) -> None:
    """Write .obj; the options are those of `surfaces`.

    Raises:
        InputError: if the resolution is impossible, the format cannot hold the surface, or the file cannot be written.
    """
    write_bytes(path, obj_bytes(surfaces(assembly, path, merged, resolution, device)))


def obj_bytes(surfaces: list[Surface]) -> bytes:
    """Wavefront OBJ: one object a surface, colours behind the coordinates of each vertex."""
    everything = joined(surfaces).vertices
    extent = float(np.ptp(everything, axis=0).max()) if len(everything) else 0.0
    # Seven digits below the extent, however far from the origin: 1e-7 of the size is what float32 holds.
    digits = max(0, 7 - math.floor(math.log10(extent))) if extent > 0.0 else 7
    lines, start = ["# resfit"], 1
    for surface, name in zip(surfaces, obj_names([surface.name for surface in surfaces]), strict=True):
        lines.append(f"o {name}")
        for (x, y, z), (red, green, blue) in zip(
            surface.vertices.tolist(), (surface.colors / 255.0).tolist(), strict=True
        ):
            lines.append(f"v {x:.{digits}f} {y:.{digits}f} {z:.{digits}f} {red:.4f} {green:.4f} {blue:.4f}")
        lines += [f"f {a} {b} {c}" for a, b, c in (surface.faces + start).tolist()]
        start += len(surface.vertices)
    return ("\n".join(lines) + "\n").encode()


def obj_names(names: list[str]) -> list[str]:
    """Names without backslashes, none twice: one at the end of a line would join it to the next."""
    made: list[str] = []
    taken = set(names)
    for name in names:
        plain, number = name.replace("\\", "/"), 1
        while plain != name and plain in taken:
            number += 1
            plain = f"{name.replace(chr(92), '/')}-{number}"
        taken.add(plain)
        made.append(plain)
    return made


EXPORTER = Exporter((".obj",), write_obj)
