"""Surfaces of an assembly as triangle meshes: the smooth union in one, or each part alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from ..kernels.rows import GATE, ROTATION, TRANSLATION
from .primitive import Primitive, shown
from .transform import Transform

if TYPE_CHECKING:
    import trimesh

    from ..kernels.field.primitive_set import PrimitiveSet

MAX_RESOLUTION = 512
"""A grid of twice as many cells a side takes gigabytes."""

MAX_EXTENT = 1e3
"""Normalised units: everything should lie within 1 of the origin, and no grid reaches so far."""

Surface = tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]


def check_resolution(resolution: int) -> None:
    """Refuse a resolution that no grid can have.

    Raises:
        InputError: if it is not in [4, MAX_RESOLUTION].
    """
    if not 4 <= resolution <= MAX_RESOLUTION:
        raise InputError(f"resolution is {resolution}; it must lie in [4, {MAX_RESOLUTION}]")


def check_extent(primitive: Primitive) -> None:
    """Refuse a primitive so large or so far away that no grid can hold it.

    Raises:
        InputError: if a length or coordinate of it is above MAX_EXTENT.
    """
    numbers = np.abs(primitive.row()[TRANSLATION:GATE])
    if numbers.max() > MAX_EXTENT:
        raise InputError(
            f"part {shown(primitive.name)} has a length or coordinate of {numbers.max():g};"
            " a surface is made only of what lies near [-1, 1], the normalised frame"
        )


def union_surface(primitives: Sequence[Primitive], resolution: int, device: str = "auto") -> Surface:
    """The surface of the smooth union in the normalised frame: vertices (v, 3), faces (f, 3).

    Raises:
        InputError: if the resolution is not in [4, MAX_RESOLUTION], or a part is too large for a grid.
    """
    check_resolution(resolution)
    if not primitives:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    for primitive in primitives:
        check_extent(primitive)
    from ..kernels.contour.isosurface import extract_isosurface

    rows = np.stack([primitive.row() for primitive in primitives])
    families = [primitive.family for primitive in primitives]
    vertices, faces = extract_isosurface(_on_device(rows, families, device), resolution)
    return np.asarray(vertices, np.float64), np.asarray(faces, np.int64)


def union_mesh(
    primitives: Sequence[Primitive], transform: Transform, resolution: int, device: str = "auto"
) -> trimesh.Trimesh:
    """The surface of the smooth union, in the mesh's own frame; without a triangle if nothing is inside.

    Raises:
        InputError: if the resolution is not in [4, MAX_RESOLUTION].
    """
    vertices, faces = union_surface(primitives, resolution, device)
    return _mesh(transform.to_mesh(vertices), faces)


def part_meshes(
    primitives: Sequence[Primitive], transform: Transform, resolution: int, device: str = "auto"
) -> list[trimesh.Trimesh]:
    """The surface of each part, in the mesh's own frame, with its name in `metadata["name"]`.

    Raises:
        InputError: if the resolution is not in [4, MAX_RESOLUTION].
    """
    meshes = []
    for primitive in primitives:
        vertices, faces = part_surface(primitive, resolution, device)
        world = vertices @ primitive.pose.matrix().T + np.asarray(primitive.pose.translation)
        meshes.append(_mesh(transform.to_mesh(world), faces, name=primitive.name))
    return meshes


def part_surface(primitive: Primitive, resolution: int, device: str = "auto") -> Surface:
    """The surface of one primitive in its own local frame, normalised units.

    Args:
        primitive: which.
        resolution: cells along the longest side of the primitive.
        device: where the field is evaluated.

    Returns:
        vertices (v, 3) and faces (f, 3), counter-clockwise from outside; none if nothing is inside.

    Raises:
        InputError: if the resolution is not in [4, MAX_RESOLUTION].
    """
    from ..kernels.contour.part_isosurface import part_isosurface

    check_resolution(resolution)
    check_extent(primitive)
    row = primitive.row()
    row[TRANSLATION : TRANSLATION + 3] = 0.0
    row[ROTATION : ROTATION + 4] = (1.0, 0.0, 0.0, 0.0)
    vertices, faces = part_isosurface(_on_device(row[None], [primitive.family], device), 0, resolution)
    return vertices.astype(np.float64), faces.astype(np.int64)


def _on_device(rows: npt.NDArray[np.float32], families: list[str], device: str) -> PrimitiveSet:
    from ..kernels.field.primitive_set import PrimitiveSet
    from ..kernels.runtime.launch import choose_device

    return PrimitiveSet(rows, families, choose_device(device))


def _mesh(vertices: npt.NDArray[Any], faces: npt.NDArray[Any], **metadata: Any) -> trimesh.Trimesh:
    import trimesh

    return trimesh.Trimesh(vertices, faces, process=False, metadata=metadata)
