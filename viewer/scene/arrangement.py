"""Arrangement of a scene: assemblies in one frame, side by side or not, exploded or not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...assembly.assembly import Assembly
from ...assembly.primitive import Pose, Vector
from ...assembly.transform import Transform
from ...kernels.field.bounds import primitive_bounds
from ..model.comparison import Comparison
from ..model.edit_session import EditSession
from ..model.poses import to_vector
from ..model.view_options import View

GAP = 0.08
"""Between things that stand side by side, scene units."""

Box = tuple[np.ndarray, np.ndarray]
"""Lowest and highest corner, (3,) each."""


@dataclass(frozen=True)
class Placed:
    """One assembly of the scene, as it is to be drawn."""

    item: int
    assembly: Assembly
    """Without hidden parts, and exploded."""
    whole: Assembly
    """With them, and as it is."""
    matrix: np.ndarray
    """(4, 4), its normalised frame to the scene's: scales and moves only."""
    offset: np.ndarray
    """(3,), the share of that which only sets things side by side."""
    comparison: Comparison | None
    mesh_matrix: np.ndarray
    """(4, 4), the normalised frame of its target to the scene's."""
    shows_mesh: bool
    """Whether the target is drawn with this one: false where an earlier one has the same."""


@dataclass(frozen=True)
class Arrangement:
    """Everything in its place. The scene's frame is the normalised one of the first assembly."""

    placed: tuple[Placed, ...]
    lower: np.ndarray
    upper: np.ndarray
    """Corners (3,) of a box around all, offsets left out."""

    def plane(self, view: View) -> tuple[int, float]:
        """Axis and coordinate of the plane of sections and slices, offsets left out."""
        axis = "xyz".index(view.section or "z")
        return axis, float(self.lower[axis] + view.section_at * (self.upper[axis] - self.lower[axis]))


def arrange(session: EditSession, view: View, comparisons: Sequence[Comparison | None]) -> Arrangement:
    """Arrange everything of a scene."""
    base = session.state.assemblies[0].transform
    seen: list[Comparison] = []
    placed: list[Placed] = []
    boxes: list[Box] = []
    edge: float | None = None
    for item, (whole, comparison) in enumerate(zip(session.state.assemblies, comparisons, strict=True)):
        matrix = between(whole.transform, base)
        mesh_matrix = np.eye(4) if comparison is None else between(comparison.transform, base)
        box = _box(whole, matrix)
        offset, shows = np.zeros(3), comparison is not None and comparison not in seen
        if comparison is not None and shows:
            seen.append(comparison)
            mesh_box = _in_scene(comparison.box, mesh_matrix)
            mesh_offset = np.zeros(3)
            if view.mesh == "beside":
                edge = _after(edge, mesh_box, mesh_offset, view.across)
            boxes.append(mesh_box)
            mesh_matrix = _moved(mesh_matrix, mesh_offset)
        if view.mesh == "beside":
            edge = _after(edge, box, offset, view.across)
        boxes.append(box)
        drawn = exploded(session.state.shown_assembly(item), view.explode)
        placed.append(
            Placed(item, drawn, whole, _moved(matrix, offset), offset, comparison, mesh_matrix, shows)
        )
    lower = np.min([low for low, _ in boxes], axis=0)
    upper = np.max([high for _, high in boxes], axis=0)
    return Arrangement(tuple(placed), lower, upper)


def exploded(assembly: Assembly, explode: float) -> Assembly:
    """Parts moved away from their common middle, what joins them let go; the same object where nothing moves."""
    parts = assembly.primitives
    if explode == 0.0 or len(parts) < 2:
        return assembly
    middle = np.mean([part.pose.translation for part in parts], axis=0)
    moved = []
    for part in parts:
        place = np.asarray(part.pose.translation)
        pose = Pose(to_vector(place + explode * (place - middle)), part.pose.rotation)
        moved.append(replace(part, pose=pose, blend=part.blend * max(0.0, 1.0 - 4.0 * explode)))
    return replace(assembly, primitives=tuple(moved))


def between(source: Transform, base: Transform) -> np.ndarray:
    """(4, 4) from the normalised frame of one transform to that of another."""
    matrix = np.eye(4)
    matrix[:3, :3] *= source.scale / base.scale
    matrix[:3, 3] = np.subtract(source.translation, base.translation) / base.scale
    return matrix


def _box(assembly: Assembly, matrix: np.ndarray) -> Box:
    if not assembly.primitives:
        return _in_scene((-np.ones(3), np.ones(3)), matrix)
    boxes = primitive_bounds(assembly.on_device("cpu"))
    return _in_scene((boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)), matrix)


def _in_scene(box: Box, matrix: np.ndarray) -> Box:
    return matrix[0, 0] * box[0] + matrix[:3, 3], matrix[0, 0] * box[1] + matrix[:3, 3]


def _after(edge: float | None, box: Box, offset: np.ndarray, across: Vector) -> float:
    """Set `offset` so that the box begins behind `edge` along `across`, and return its own edge."""
    middle = float(np.dot(across, 0.5 * (box[0] + box[1])))
    half = float(np.dot(np.abs(across), 0.5 * (box[1] - box[0])))
    step = 0.0 if edge is None else edge + GAP - (middle - half)
    offset[:] = step * np.asarray(across)
    return middle + half + step


def _moved(matrix: np.ndarray, offset: np.ndarray) -> np.ndarray:
    moved = matrix.copy()
    moved[:3, 3] += offset
    return moved
