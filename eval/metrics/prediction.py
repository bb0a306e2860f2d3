"""Interface of a reconstruction for metrics, whoever made it, and its implementation by an assembly.

Everything is in the target's normalised frame. The other kind of reconstruction, meshes of parts, is in
`prediction_parts`; both are read from files by `prediction_files`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from ...assembly.assembly import Assembly
from ...assembly.change_of_frame import rows_in_frame
from ...assembly.transform import Transform
from ...kernels.contour.isosurface import extract_isosurface
from ...kernels.field.bounds import assembly_bounds
from ...kernels.field.evaluate import evaluate_assembly, evaluate_primitives
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.mesh.mesh_query import MeshQuery
from ...kernels.runtime.launch import choose_device
from .assembly_metrics import RESOLUTION, Occupancy, count_floats, measure_occupancy
from .surface_metrics import draw_surface


class Prediction(Protocol):
    """A reconstruction of a target, in the target's normalised frame."""

    primitive_count: int
    floats: int
    """Numbers needed to store it."""
    lower: np.ndarray
    upper: np.ndarray
    """(3,) float64 each, corners of its surface's box; both 0 if it has no surface."""

    def occupancy(self) -> Occupancy:
        """Occupancy at the 128^3 cell centres of [-1, 1]^3."""
        ...

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Point membership: True where points (n, 3) are inside the whole, (n,) bool."""
        ...

    def owners(self, points: np.ndarray) -> np.ndarray:
        """For points (n, 3) the primitive whose surface is nearest, (n,) int; there must be a primitive."""
        ...

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Distance (n,) of points (n, 3) to the surface of the whole, without a sign; there must be one."""
        ...

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Points (count, 3) float32 on the surface of the whole, by area; (0, 3) if there is none."""
        ...


class AssemblyPrediction:
    """An assembly as a prediction: analytic fields wherever they will do, and its projected isosurface to draw from."""

    def __init__(self, assembly: Assembly, frame: Transform, device: str = "auto") -> None:
        """Move `assembly` into the normalised frame `frame` of the target."""
        self.primitive_count = len(assembly.primitives)
        self.floats = count_floats(assembly)
        families = [primitive.family for primitive in assembly.primitives]
        self.primitives = PrimitiveSet(rows_in_frame(assembly, frame), families, choose_device(device))
        self.vertices, self.faces = np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32)
        self.lower, self.upper = np.zeros(3), np.zeros(3)
        if families:
            self.vertices, self.faces = extract_isosurface(self.primitives, RESOLUTION)
            self.lower, self.upper = assembly_bounds(self.primitives)
        if len(self.faces):
            self.lower = self.vertices.min(axis=0).astype(np.float64)
            self.upper = self.vertices.max(axis=0).astype(np.float64)

    def occupancy(self) -> Occupancy:
        """See `Prediction`."""
        return measure_occupancy(self.primitives)

    def inside(self, points: np.ndarray) -> np.ndarray:
        """See `Prediction`."""
        return evaluate_assembly(self.primitives, points) < 0.0

    def owners(self, points: np.ndarray) -> np.ndarray:
        """See `Prediction`."""
        return np.abs(evaluate_primitives(self.primitives, points)).argmin(axis=0)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """See `Prediction`. The field's size, but where a family's field is only roughly a distance."""
        if any(run.family.approximate for run in self.primitives.runs):
            return mesh_distance(MeshQuery(self.vertices, self.faces, self.primitives.device), points)
        return np.abs(evaluate_assembly(self.primitives, points))

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """See `Prediction`."""
        if not len(self.faces):
            return np.zeros((0, 3), np.float32)
        return draw_surface(self.vertices, self.faces, count, rng)


def mesh_distance(query: MeshQuery, points: np.ndarray) -> np.ndarray:
    """Distance (n,) float32 of points (n, 3) to a mesh's faces, without a sign."""
    import warp as wp

    asked = wp.array(np.ascontiguousarray(points, np.float32), dtype=wp.vec3, device=query.device)
    return query.closest_points(asked).distance.numpy()


def box_alignment(
    lower: np.ndarray, upper: np.ndarray, to_lower: np.ndarray, to_upper: np.ndarray
) -> Transform:
    """The scale and shift that centre a box on another one and give it the other's longest side.

    The same factor along all axes: a prediction of other proportions is wrong, and stretching it would hide that.

    Args:
        lower, upper: corners (3,) of the box to move, of some extent. to_lower, to_upper: those of the other one.
    """
    scale = float((to_upper - to_lower).max() / (upper - lower).max())
    x, y, z = (0.5 * (to_lower + to_upper) - scale * 0.5 * (lower + upper)).tolist()
    return Transform(scale, (x, y, z))


def moved(assembly: Assembly, motion: Transform) -> Assembly:
    """An assembly whose points in the mesh's frame are moved by `motion`: its transform followed by that."""
    x, y, z = motion.to_mesh([assembly.transform.translation])[0].tolist()
    return replace(assembly, transform=Transform(motion.scale * assembly.transform.scale, (x, y, z)))
