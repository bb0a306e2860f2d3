"""Handles on the selected part: arrows move it along its axes, rings turn it, cubes stretch it, a ball moves it freely.

The first half is geometry without VTK; `Gizmo` draws the handles in a layer over the scene, and tells which is where.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ...kernels.rotation import rotation_about
from ..scene.camera import OrbitCamera
from ..scene.plotter import Plotter

SHARE = 0.125
"""Size of the handles as a share of the camera's distance: the same on the screen however near."""

RING, ARROW, CUBE = 0.78, 1.0, 1.22
"""Radius of the rings, length of the arrows and place of the cubes, in handle sizes."""

COLORS = ("#d1495b", "#2b9348", "#3b6ea8")
BALL_COLOR, HOT_COLOR = "#6a717b", "#f5a623"

SMALLEST_FACTOR = 0.02
"""Of a stretch: a part pulled through itself stays this thin."""

Ray = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Handle:
    """One handle: what it does, and along or about which local axis."""

    kind: Literal["move", "turn", "stretch", "free"]
    axis: int


HANDLES = (
    *(Handle("move", axis) for axis in range(3)),
    *(Handle("turn", axis) for axis in range(3)),
    *(Handle("stretch", axis) for axis in range(3)),
    Handle("free", 0),
)


def dragged(handle: Handle, matrix: np.ndarray, begin: Ray, now: Ray, facing: np.ndarray) -> np.ndarray:
    """Affine transform of a part after the drag of a handle.

    Args:
        handle: which.
        matrix: (4, 4), local frame of the part to the scene's when it was taken hold of: axes may be scaled alike.
        begin, now: rays (origin, unit direction) under the pointer, then and now, scene's frame.
        facing: unit vector (3,) of the view.

    Returns:
        (4, 4), local frame to the scene's; `matrix` itself where the rays say nothing.
    """
    centre = matrix[:3, 3]
    axis = matrix[:3, handle.axis] / np.linalg.norm(matrix[:3, handle.axis])
    change = np.eye(4)
    if handle.kind == "move":
        change[:3, 3] = (_along(centre, axis, now) - _along(centre, axis, begin)) * axis
    elif handle.kind == "free":
        change[:3, 3] = _meet(centre, facing, now) - _meet(centre, facing, begin)
    elif handle.kind == "stretch":
        start = _along(centre, axis, begin)
        factor = max(SMALLEST_FACTOR, _along(centre, axis, now) / start) if abs(start) > 1e-9 else 1.0
        stretch = np.eye(4)
        stretch[handle.axis, handle.axis] = factor
        return matrix @ stretch
    else:
        angle = _angle(_meet(centre, axis, begin) - centre, _meet(centre, axis, now) - centre, axis)
        turn = rotation_about(axis, angle)
        change[:3, :3], change[:3, 3] = turn, centre - turn @ centre
    return change @ matrix


def _along(centre: np.ndarray, axis: np.ndarray, ray: Ray) -> float:
    """Closest point of a line to a ray: distance from `centre` along the unit vector `axis`."""
    origin, towards = ray
    between = origin - centre
    cosine = float(axis @ towards)
    return float(between @ axis - cosine * (between @ towards)) / max(1.0 - cosine * cosine, 1e-4)


def _meet(centre: np.ndarray, normal: np.ndarray, ray: Ray) -> np.ndarray:
    """Intersection of a ray and a plane; seen from the side, the ray's closest point to its middle."""
    origin, towards = ray
    steep = float(normal @ towards)
    if abs(steep) < 0.05:
        return origin + max(0.0, float((centre - origin) @ towards)) * towards
    return origin + float((centre - origin) @ normal) / steep * towards


def _angle(a: np.ndarray, b: np.ndarray, axis: np.ndarray) -> float:
    return float(np.arctan2(np.cross(a, b) @ axis, a @ b - (a @ axis) * (b @ axis)))


class Gizmo:
    """The handles as actors of a layer of their own, never hidden by the scene."""

    def __init__(self, plotter: Plotter, layer: int) -> None:
        """Draw into a plotter's window, over the layers below `layer`."""
        from vtkmodules.vtkRenderingCore import vtkRenderer

        self.plotter = plotter
        self.renderer: Any = vtkRenderer()
        self.renderer.SetLayer(layer)
        self.renderer.InteractiveOff()
        self.renderer.SetActiveCamera(plotter.renderer.GetActiveCamera())
        window: Any = plotter.render_window
        window.SetNumberOfLayers(max(layer + 1, window.GetNumberOfLayers()))
        window.AddRenderer(self.renderer)
        self.actors: dict[Handle, Any] = {handle: _make(handle) for handle in HANDLES}
        for actor in self.actors.values():
            self.renderer.AddActor(actor)
        self.matrix = np.eye(4)
        self.hot: Handle | None = None
        self.place(None, OrbitCamera())

    def place(self, matrix: np.ndarray | None, camera: OrbitCamera) -> None:
        """Put the handles on a part's local frame (4, 4) in the scene's, or nowhere."""
        for actor in self.actors.values():
            actor.SetVisibility(matrix is not None)
        if matrix is None:
            return
        self.matrix = matrix
        view = camera.view()
        depth = float((matrix[:3, 3] - np.asarray(view.position)) @ view.axes[2])
        shown = matrix.copy()
        shown[:3, :3] *= SHARE * max(depth, 1e-3) * np.tan(np.radians(camera.field_of_view / 2)) / 0.27
        shown[:3, :3] /= np.linalg.norm(matrix[:3, :3], axis=0)
        for actor in self.actors.values():
            actor.user_matrix = shown

    def at(self, x: float, y: float) -> Handle | None:
        """The handle at a pixel of the window, counted from its lower left corner."""
        from vtkmodules.vtkRenderingCore import vtkCellPicker

        if not any(actor.GetVisibility() for actor in self.actors.values()):
            return None
        picker = vtkCellPicker()
        picker.SetTolerance(0.003)
        if not picker.Pick(x, y, 0.0, self.renderer):
            return None
        found = picker.GetActor()
        return next((handle for handle, actor in self.actors.items() if actor is found), None)

    def light(self, handle: Handle | None) -> bool:
        """Mark the handle under the pointer; whether that changed."""
        if handle == self.hot:
            return False
        for each in (self.hot, handle):
            if each is not None:
                self.actors[each].prop.color = HOT_COLOR if each is handle else _color(each)
        self.hot = handle
        return True


def _color(handle: Handle) -> str:
    return BALL_COLOR if handle.kind == "free" else COLORS[handle.axis]


def _make(handle: Handle) -> Any:
    import pyvista as pv

    direction = np.eye(3)[handle.axis]
    if handle.kind == "move":
        # Rings and arrows both begin outside the ball.
        start, length = 0.14, ARROW - 0.14
        mesh: Any = pv.Arrow(
            start=direction * start, direction=direction, scale=length, tip_length=0.2, tip_radius=0.055,
            shaft_radius=0.018, tip_resolution=20, shaft_resolution=12,
        )  # fmt: skip
    elif handle.kind == "turn":
        angles = np.linspace(0.0, 2.0 * np.pi, 65)
        u, v = (np.eye(3)[other] for other in range(3) if other != handle.axis)
        ring = RING * (np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * v)
        spline: Any = pv.lines_from_points(ring)
        mesh = spline.tube(radius=0.014, n_sides=8)
    elif handle.kind == "stretch":
        centre = tuple(float(value) for value in direction * CUBE)
        mesh = pv.Cube(center=centre, x_length=0.11, y_length=0.11, z_length=0.11)
    else:
        mesh = pv.Sphere(radius=0.08, theta_resolution=20, phi_resolution=16)
    actor = pv.Actor(mapper=pv.DataSetMapper(dataset=mesh.extract_surface(algorithm=None).clean()))
    actor.mapper.scalar_visibility = False
    actor.prop.color = _color(handle)
    actor.prop.ambient, actor.prop.diffuse = 0.75, 0.35
    return actor
