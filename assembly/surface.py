"""Surfaces of an assembly as triangle meshes: the smooth union in one, or each part alone.

A part is sampled in its own frame, on a grid fitted to it and finer along its short sides: a thin plate would
fall between the cells of a grid over the whole scene.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from ..kernels.primitives import FAMILIES
from ..kernels.rows import ROTATION, TRANSLATION
from .primitive import Primitive

if TYPE_CHECKING:
    import trimesh

    from .assembly import Assembly

MIN_CELLS = 16
"""Cells across a part's shortest side."""

MAX_PART_RESOLUTION = 256
"""Bent sheets and thin walls are sampled up to this finely, whatever was asked for: else they get holes."""

BOUNDS_CELLS = 20
"""Cells a side of the grid from which a part's bounds are found."""

MAX_RESOLUTION = 1024
"""Above it a grid no longer fits into memory."""

Surface = tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]


def check_resolution(resolution: int) -> None:
    """Refuse a resolution that no grid can have.

    Raises:
        InputError: if it is not in [4, MAX_RESOLUTION].
    """
    if not 4 <= resolution <= MAX_RESOLUTION:
        raise InputError(f"resolution is {resolution}; it must lie in [4, {MAX_RESOLUTION}]")


def union_surface(assembly: Assembly, resolution: int, device: str = "auto") -> Surface:
    """The surface of the smooth union in the normalised frame: vertices (v, 3), faces (f, 3).

    Raises:
        InputError: if the resolution is not in [4, MAX_RESOLUTION].
    """
    check_resolution(resolution)
    if not assembly.primitives:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    from ..kernels.isosurface import extract_isosurface

    vertices, faces = extract_isosurface(assembly.on_device(device), resolution)
    return np.asarray(vertices, np.float64), np.asarray(faces, np.int64)


def union_mesh(assembly: Assembly, resolution: int, device: str = "auto") -> trimesh.Trimesh:
    """The surface of the smooth union, in the mesh's own frame; without a triangle if nothing is inside.

    Raises:
        InputError: if the resolution is not in [4, MAX_RESOLUTION].
    """
    vertices, faces = union_surface(assembly, resolution, device)
    return _mesh(assembly.transform.to_mesh(vertices), faces)


def part_meshes(assembly: Assembly, resolution: int, device: str = "auto") -> list[trimesh.Trimesh]:
    """The surface of each part, in the mesh's own frame, with its name in `metadata["name"]`.

    Raises:
        InputError: if the resolution is not in [4, MAX_RESOLUTION].
    """
    meshes = []
    for primitive in assembly.primitives:
        vertices, faces = part_surface(primitive, resolution, device)
        world = vertices @ primitive.pose.matrix().T + np.asarray(primitive.pose.translation)
        meshes.append(_mesh(assembly.transform.to_mesh(world), faces, name=primitive.name))
    return meshes


def part_surface(primitive: Primitive, resolution: int, device: str = "auto") -> Surface:
    """The surface of one primitive in its own local frame, normalised units.

    Args:
        resolution: cells along the longest side of the primitive; short sides have at least MIN_CELLS.

    Returns:
        vertices (v, 3) and faces (f, 3), counter-clockwise from outside; none if nothing is inside.

    Raises:
        InputError: if the resolution is not in [4, MAX_RESOLUTION].
    """
    check_resolution(resolution)
    field = LocalField(primitive, device)
    low, high = field.bounds()
    vertices, faces, cell = _marched(field, low, high, resolution)
    while resolution < MAX_PART_RESOLUTION and not _covers(vertices, field.surface, cell):
        resolution = min(2 * resolution, MAX_PART_RESOLUTION)
        vertices, faces, cell = _marched(field, low, high, resolution)
    return vertices, faces


def _marched(
    field: LocalField, low: npt.NDArray[np.float64], high: npt.NDArray[np.float64], resolution: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64], float]:
    """Vertices, faces and the diagonal of a cell, of the surface within the box from `low` to `high`."""
    from skimage.measure import marching_cubes

    side = np.maximum(high - low, 1e-6)
    cells = np.clip(np.ceil(resolution * side / side.max()), min(MIN_CELLS, resolution), resolution)
    # A cell more on every side, so that the surface closes inside the grid.
    low, high, cells = low - side / cells, high + side / cells, cells + 2
    # An odd number, so that no grid point lies on a symmetry axis: the hole of a nearly solid form is there.
    cells += 1 - cells % 2
    axes = [np.linspace(low[axis], high[axis], int(cells[axis]) + 1) for axis in range(3)]
    spacing = (high - low) / cells
    diagonal = float(np.linalg.norm(spacing))
    values = field.on_grid(axes)
    if not values.min() < 0.0 < values.max():
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64), diagonal
    # A grid point on the surface would make triangles without area, and holes where those are dropped.
    least = 1e-3 * float(spacing.min())
    values = np.where(np.abs(values) < least, np.copysign(least, values), values)
    vertices, faces, _, _ = marching_cubes(values, 0.0, spacing=tuple(spacing.tolist()))
    return vertices.astype(np.float64) + low, faces.astype(np.int64), diagonal


def _covers(vertices: npt.NDArray[np.float64], surface: npt.NDArray[np.float64], cell: float) -> bool:
    """Whether points on the surface have a vertex near: thin sheets fall through coarse grids."""
    from scipy.spatial import KDTree

    if not len(vertices) or not len(surface):
        return not len(surface)
    distance, _ = KDTree(vertices).query(surface)
    return float(np.mean(distance > cell)) < 0.05


class LocalField:
    """The field of one primitive in its own local frame, normalised units, negative inside."""

    def __init__(self, primitive: Primitive, device: str = "auto") -> None:
        from ..kernels.field import PrimitiveSet
        from ..kernels.launch import choose_device

        row = primitive.row()[None].copy()
        row[0, TRANSLATION : TRANSLATION + 3] = 0.0
        row[0, ROTATION : ROTATION + 4] = (1.0, 0.0, 0.0, 0.0)
        self._set = PrimitiveSet(row, [primitive.family], choose_device(device))
        lengths = [
            np.atleast_1d(primitive.parameters[parameter.name])
            for parameter in FAMILIES[primitive.family].parameters
            if parameter.unit == "length"
        ]
        # Nothing sticks out farther than twice its extents (a taper of 2) and its dilation.
        self.surface = np.zeros((0, 3))
        """Points (n, 3) on the surface, found on the way to the bounds."""
        self._reach = 2.0 * float(np.linalg.norm(np.concatenate(lengths))) + 1e-6

    def at(self, points: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
        """Signed distance (n,) at local points (n, 3)."""
        from ..kernels.field import evaluate_primitives

        return evaluate_primitives(self._set, np.ascontiguousarray(points, np.float32))[0]

    def on_grid(self, axes: list[npt.NDArray[Any]]) -> npt.NDArray[np.float32]:
        """Signed distance at the points of a grid given by its three axes."""
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        return self.at(points.reshape(-1, 3)).reshape(points.shape[:3])

    def bounds(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Lowest and highest corner (3,) of the box around the surface, without a margin."""
        low, high = np.full(3, -self._reach), np.full(3, self._reach)
        tight = low, high
        for _ in range(4):
            axes = [np.linspace(low[axis], high[axis], BOUNDS_CELLS + 1) for axis in range(3)]
            points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
            # The field says how far the surface is, with room for bent forms, which overstate it.
            value = self.at(points)
            near = value <= float(np.linalg.norm((high - low) / BOUNDS_CELLS))
            surface = self._projected(points[near])
            if not len(surface):
                break
            low, high = surface.min(axis=0), surface.max(axis=0)
            tight = low, high
            # Only what shows from outside: the hole of a nearly solid form is too thin for any grid.
            self.surface = self._projected(points[near & (value > 0.0)])
            margin = 0.1 * float((high - low).max())
            low, high = low - margin, high + margin
        return tight

    def _projected(self, points: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
        """Where `points` (n, 3) meet the surface, going down the field; those that do not are dropped."""
        if not len(points):
            return points
        step = 1e-3 * float(np.ptp(points, axis=0).max())
        for _ in range(4):
            around = [points + side * step * np.eye(3)[axis] for axis in range(3) for side in (1.0, -1.0)]
            values = self.at(np.concatenate([points, *around])).astype(np.float64).reshape(7, -1)
            slope = (values[1::2] - values[2::2]).T / (2.0 * step)
            steep = np.maximum((slope * slope).sum(axis=1, keepdims=True), 0.25)
            points = points - values[0][:, None] * slope / steep
        return points[np.abs(self.at(points)) < step]


def _mesh(vertices: npt.NDArray[Any], faces: npt.NDArray[Any], **metadata: Any) -> trimesh.Trimesh:
    import trimesh

    return trimesh.Trimesh(vertices, faces, process=False, metadata=metadata)
