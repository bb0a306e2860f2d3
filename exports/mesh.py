"""Triangle meshes: GLB and OBJ with one named object a part, PLY and STL with one surface of the smooth union."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from ..assembly.atomic_write import write_bytes
from ..assembly.colors import rgb
from ..assembly.surface import check_resolution
from .glb import glb_of_parts, glb_of_union

if TYPE_CHECKING:
    from ..assembly.assembly import Assembly

PART_RESOLUTION, UNION_RESOLUTION = 32, 128
"""Cells along the longest side of a part, or of the scene, where nothing is asked for."""


@dataclass(frozen=True)
class Surface:
    """A named triangle mesh in mesh units; `colors` (v, 3) are sRGB bytes."""

    name: str
    vertices: npt.NDArray[np.float64]
    faces: npt.NDArray[np.int64]
    colors: npt.NDArray[np.uint8]


def write_mesh(
    assembly: Assembly,
    path: Path,
    *,
    merged: bool | None = None,
    resolution: int | None = None,
    device: str = "auto",
) -> None:
    """Write .glb, .obj, .ply or .stl.

    Args:
        assembly: what to write.
        path: its suffix chooses the format.
        merged: one surface of the smooth union (what PLY and STL get if None), or one closed surface a part.
        resolution: cells along the longest side, of the whole or of each part.
        device: where the field is evaluated.

    Raises:
        InputError: if the resolution is impossible, the format cannot hold the surface, or the file cannot be written.
    """
    suffix = path.suffix.lower()
    merged = suffix in (".ply", ".stl") if merged is None else merged
    resolution = (UNION_RESOLUTION if merged else PART_RESOLUTION) if resolution is None else resolution
    check_resolution(resolution)
    if suffix == ".glb":
        writer = glb_of_union if merged else glb_of_parts
        write_bytes(path, writer(assembly, resolution, device))
        return
    surfaces = _surfaces(assembly, merged, resolution, device)
    _check_coordinates(_joined(surfaces), path)
    encode = {".obj": obj_bytes, ".ply": ply_bytes, ".stl": stl_bytes}[suffix]
    write_bytes(path, encode(surfaces))


def _check_coordinates(whole: Surface, path: Path) -> None:
    """Refuse what would be an empty file, or one whose numbers say nothing.

    Raises:
        InputError: if there is no face, or a coordinate is too large or, for the size of the whole, too far away.
    """
    if not len(whole.faces):
        raise InputError(f"cannot write {path}: the assembly has no surface, so the file would be empty.")
    number = np.float32 if path.suffix.lower() == ".stl" else np.float64
    lower, upper = whole.vertices.min(axis=0), whole.vertices.max(axis=0)
    largest = float(max(np.abs(lower).max(), np.abs(upper).max()))
    # Of halves: the difference of two large numbers may overflow.
    half = float((upper / 2 - lower / 2).max())
    if not max(largest, 2.0 * half) <= float(np.finfo(number).max):
        raise InputError(
            f"cannot write {path}: coordinates reach {largest:.3g}, more than the format holds; scale it down."
        )
    if half < np.spacing(number(largest)):
        raise InputError(
            f"cannot write {path}: at {largest:.3g} from the origin, numbers of the format cannot hold a shape that"
            f" is {2.0 * half:.3g} large."
        )


def union_colors(assembly: Assembly, points: npt.NDArray[np.float64], device: str) -> npt.NDArray[np.uint8]:
    """sRGB bytes (n, 3): at each point (n, 3), mesh units, the colour of the part that is nearest."""
    palette = np.array([rgb(primitive.color) for primitive in assembly.primitives]).reshape(-1, 3)
    if not len(points) or not len(palette):
        return np.zeros((len(points), 3), np.uint8)
    nearest = assembly.primitive_sdf(points, device).argmin(axis=1)
    return np.round(palette[nearest] * 255.0).astype(np.uint8)


def _surfaces(assembly: Assembly, merged: bool, resolution: int, device: str) -> list[Surface]:
    if merged:
        mesh = assembly.to_mesh(resolution, device)
        vertices = np.asarray(mesh.vertices)
        colors = union_colors(assembly, vertices, device)
        return [Surface("assembly", vertices, np.asarray(mesh.faces), colors)]
    surfaces = []
    for primitive, mesh in zip(assembly.primitives, assembly.part_meshes(resolution, device), strict=True):
        color = np.round(np.array(rgb(primitive.color)) * 255.0).astype(np.uint8)
        vertices = np.asarray(mesh.vertices)
        colors = np.tile(color, (len(vertices), 1))
        surfaces.append(Surface(primitive.name, vertices, np.asarray(mesh.faces), colors))
    return surfaces


def _joined(surfaces: list[Surface]) -> Surface:
    """All surfaces as one."""
    starts = np.cumsum([0, *[len(surface.vertices) for surface in surfaces]])
    return Surface(
        "assembly",
        np.concatenate([np.zeros((0, 3)), *[surface.vertices for surface in surfaces]]),
        np.concatenate(
            [
                np.zeros((0, 3), np.int64),
                *[surface.faces + start for surface, start in zip(surfaces, starts[:-1], strict=True)],
            ]
        ),
        np.concatenate([np.zeros((0, 3), np.uint8), *[surface.colors for surface in surfaces]]),
    )


def obj_bytes(surfaces: list[Surface]) -> bytes:
    """Wavefront OBJ: one object a surface, colours behind the coordinates of each vertex."""
    everything = _joined(surfaces).vertices
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


def ply_bytes(surfaces: list[Surface]) -> bytes:
    """Binary PLY with colours; coordinates are doubles, so that meshes far from the origin keep their form."""
    whole = _joined(surfaces)
    vertices = np.zeros(len(whole.vertices), [("position", "<f8", 3), ("color", "u1", 3)])
    vertices["position"], vertices["color"] = whole.vertices, whole.colors
    faces = np.zeros(len(whole.faces), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, whole.faces
    header = ["ply", "format binary_little_endian 1.0", "comment resfit", f"element vertex {len(vertices)}"]
    header += [f"property double {axis}" for axis in "xyz"]
    header += [f"property uchar {channel}" for channel in ("red", "green", "blue")]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    return ("\n".join(header) + "\n").encode() + vertices.tobytes() + faces.tobytes()


def stl_bytes(surfaces: list[Surface]) -> bytes:
    """Binary STL. The format has float32 coordinates only: meshes far from the origin lose detail."""
    whole = _joined(surfaces)
    triangles = np.zeros(
        len(whole.faces), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")]
    )
    corners = whole.vertices[whole.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    triangles["normal"] = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)
    triangles["corners"] = corners
    return b"resfit".ljust(80) + len(triangles).to_bytes(4, "little") + triangles.tobytes()
