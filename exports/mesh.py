"""Triangle meshes of an assembly: what the formats of meshes have in common."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from ..assembly.colors import rgb
from ..assembly.surface import check_resolution

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


def checked_resolution(resolution: int | None, merged: bool) -> int:
    """The resolution asked for, or what suits the whole or its parts.

    Raises:
        InputError: if it is impossible.
    """
    resolution = (UNION_RESOLUTION if merged else PART_RESOLUTION) if resolution is None else resolution
    check_resolution(resolution)
    return resolution


def surfaces(
    assembly: Assembly,
    path: Path,
    merged: bool,
    resolution: int | None,
    device: str,
    number: type[np.floating[Any]] = np.float64,
) -> list[Surface]:
    """The surfaces to write to a file.

    Args:
        assembly: what to write.
        path: the file, for messages.
        merged: one surface of the smooth union, or one closed surface a part.
        resolution: cells along the longest side, of the whole or of each part; None is what suits.
        device: where the field is evaluated.
        number: type of the coordinates in the file.

    Raises:
        InputError: if the resolution is impossible, or the format cannot hold the surfaces.
    """
    found = _surfaces(assembly, merged, checked_resolution(resolution, merged), device)
    _check_coordinates(joined(found), path, number)
    return found


def _check_coordinates(whole: Surface, path: Path, number: type[np.floating[Any]]) -> None:
    """Refuse what would be an empty file, or one whose numbers say nothing.

    Raises:
        InputError: if there is no face, or a coordinate is too large or, for the size of the whole, too far away.
    """
    if not len(whole.faces):
        raise InputError(f"cannot write {path}: the assembly has no surface, so the file would be empty.")
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


def joined(surfaces: list[Surface]) -> Surface:
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
