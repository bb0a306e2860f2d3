"""An assembly against the mesh that it stands for: IoU, what is missing, what is too much, distances.

Places are in the target's normalised frame, distances in mesh units.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np

from ...assembly.assembly import Assembly
from ...assembly.surface import Surface
from ...assembly.transform import Transform
from ...eval.metrics.assembly_metrics import RESOLUTION
from ...kernels.field.evaluate import evaluate_assembly, evaluate_grid
from ...kernels.runtime.launch import choose_device
from ...shape.grid import intersection_over_union
from ...shape.load import load_mesh
from ...shape.loaded_mesh import LoadedMesh
from ...shape.target import Target, make_target

LIVE_STRIDE = 2
"""While something is dragged, every second cell along each axis counts: an eighth of the work."""

DEPTH = 0.75
"""Cells by which the residual lies deeper than the surface of it that is shown: thinner skins are noise."""

ERROR_EDGE = 0.02
"""Normalised units: faces are divided until distances are known this close to each other."""

MAX_ERROR_FACES = 60_000
"""Division stops there; meshes with more faces keep theirs."""


class Comparison:
    """A target mesh, measured when it is first needed.

    Attributes:
        mesh: as it was loaded, in its own frame.
        transform: of the target's normalised frame.
    """

    def __init__(self, mesh: str | Path, device: str = "auto") -> None:
        """Load a mesh.

        Raises:
            InputError: if it cannot be read.
        """
        self.mesh: LoadedMesh = load_mesh(mesh)
        self.device = device
        corners = self.mesh.vertices.min(axis=0), self.mesh.vertices.max(axis=0)
        self.transform = Transform.from_bounds(*corners)

    @cached_property
    def target(self) -> Target:
        """The mesh as a solid with distances: takes a second or two when it is first asked for.

        Raises:
            InputError: if the mesh holds nothing solid.
        """
        return make_target(self.mesh, choose_device(self.device), resolution=RESOLUTION, sample_count=4000)

    @cached_property
    def surface(self) -> Surface:
        """The mesh in its normalised frame."""
        return self.transform.to_normalised(self.mesh.vertices), self.mesh.faces

    @cached_property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest corner (3,) of the mesh, its normalised frame."""
        return self.surface[0].min(axis=0), self.surface[0].max(axis=0)

    @cached_property
    def fine_surface(self) -> Surface:
        """The same with large faces divided, for values at its vertices."""
        from trimesh.remesh import subdivide

        vertices, faces = self.surface
        for _ in range(8):
            corners = vertices[faces]
            longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
            large = np.flatnonzero(longest > ERROR_EDGE)
            if not len(large) or len(faces) + 3 * len(large) > MAX_ERROR_FACES:
                break
            vertices, faces = subdivide(vertices, faces, face_index=large)[:2]
        return np.asarray(vertices, np.float64), np.asarray(faces, np.int64)

    def iou(self, assembly: Assembly, live: bool = False) -> float:
        """IoU at the 128^3 cell centres of [-1, 1]^3; live, at every second one along each axis."""
        stride = LIVE_STRIDE if live else 1
        inside = self._field(assembly, stride) < 0.0
        return intersection_over_union(self.target.grid[::stride, ::stride, ::stride] < 0.0, inside)

    def distances(self, assembly: Assembly, points: np.ndarray) -> np.ndarray:
        """Signed distance (n,) of an assembly at points (n, 3), negative inside; NaN for an empty assembly."""
        if not assembly.primitives:
            return np.full(len(points), np.nan, np.float32)
        if assembly.transform == self.transform:
            field = evaluate_assembly(assembly.on_device(self.device), points.astype(np.float32))
            return field * np.float32(self.transform.scale)
        return assembly.sdf(self.transform.to_mesh(points), self.device)

    def residual(self, assembly: Assembly) -> tuple[Surface, Surface]:
        """Surfaces of what the target has and the assembly lacks, and of what the assembly has too much."""
        covered, target = self._field(assembly, 1), self.target.grid
        return _surface(np.maximum(target, -covered)), _surface(np.maximum(covered, -target))

    def _field(self, assembly: Assembly, stride: int) -> np.ndarray:
        """The assembly's field, normalised, at every `stride`-th cell centre of the target's grid."""
        count, spacing = RESOLUTION // stride, 2.0 * stride / RESOLUTION
        low = -1.0 + 1.0 / RESOLUTION
        if assembly.transform == self.transform or not assembly.primitives:
            shape = (count, count, count)
            return evaluate_grid(assembly.on_device(self.device), shape, (low, low, low), spacing)
        axis = low + spacing * np.arange(count)
        points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
        return self.distances(assembly, points).reshape((count,) * 3) / self.transform.scale


def _surface(field: np.ndarray) -> Surface:
    """Surface of a residual from its field at the cell centres of [-1, 1]^3."""
    from skimage.measure import marching_cubes

    spacing = 2.0 / RESOLUTION
    depth = -DEPTH * spacing
    if not field.min() < depth:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    # Beyond the border nothing is known: close the surface there.
    padded = np.pad(np.minimum(field, 1.0), 1, constant_values=1.0)
    vertices, faces, _, _ = marching_cubes(padded, depth, gradient_direction="ascent")
    return (vertices - 1.0) * spacing - 1.0 + 0.5 * spacing, faces.astype(np.int64)
