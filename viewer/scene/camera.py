"""The camera of the viewer: it orbits a point, as that of the page does, and knows no window."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from ...assembly.primitive import Vector
from ...kernels.render.camera import UP_AXES, Camera
from ..model.poses import to_vector

if TYPE_CHECKING:
    import pyvista as pv

AZIMUTH, ELEVATION = 35.0, 22.0
"""Degrees: from three quarters, a little above; as in previews and on pages."""

STEEPEST = 88.0
"""Degrees; straight from above there is no telling where up is."""

NEAREST, FARTHEST = 0.05, 400.0
"""Distances that can be zoomed to, scene units."""

MARGIN = 1.12
"""How much farther away than needed the camera stands, to leave room around things."""


@dataclass
class OrbitCamera:
    """Angles, distance and the point that is looked at, in the scene's frame."""

    up: Literal["y", "z"] = "y"
    azimuth: float = AZIMUTH
    elevation: float = ELEVATION
    distance: float = 4.0
    target: np.ndarray = field(default_factory=lambda: np.zeros(3))
    field_of_view: float = 30.0
    """Vertical, degrees."""

    def view(self) -> Camera:
        """The same as a camera of the ray tracer."""
        turn, lift = math.radians(self.azimuth), math.radians(self.elevation)
        side, front, top = math.cos(lift) * math.sin(turn), math.cos(lift) * math.cos(turn), math.sin(lift)
        towards = np.array([side, top, front] if self.up == "y" else [side, -front, top])
        place = self.target + self.distance * towards
        return Camera(to_vector(place), to_vector(self.target), UP_AXES[self.up], self.field_of_view)

    def across(self) -> Vector:
        """Unit vector to the right in the picture, scene's frame."""
        return to_vector(self.view().axes[0])

    def ray(self, x: float, y: float, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Origin and unit direction (3,) of the ray through a pixel, counted from the lower left of a picture."""
        view = self.view()
        slope = 2.0 * math.tan(math.radians(0.5 * self.field_of_view)) / size[1]
        right, upward, forward = view.axes
        towards = forward + slope * ((x - 0.5 * size[0]) * right + (y - 0.5 * size[1]) * upward)
        return np.asarray(view.position), towards / np.linalg.norm(towards)

    def frame(self, points: np.ndarray, aspect: float) -> None:
        """See all of some points (n, 3), n > 0, in a picture `aspect` times as wide as high."""
        self.target = 0.5 * (points.min(axis=0) + points.max(axis=0))
        slope = math.tan(math.radians(0.5 * self.field_of_view))
        slopes = np.array([slope * max(aspect, 0.1), slope])
        axes = self.view().axes
        for _ in range(3):
            # The middle of what is seen goes to the middle of the picture, which changes what is nearest.
            place = (points - self.target) @ axes.T
            self.distance = max(1e-3, float((np.abs(place[:, :2]) / slopes - place[:, 2:]).max()))
            seen = place[:, :2] / (place[:, 2:] + self.distance)
            middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0)) * self.distance
            self.target = self.target + middle @ axes[:2]
        self.distance *= MARGIN

    def orbit(self, across: float, up: float) -> None:
        """Go around the target; pixels that the pointer moved to the right and upwards."""
        self.azimuth -= 0.4 * across
        self.elevation = max(-STEEPEST, min(STEEPEST, self.elevation - 0.4 * up))

    def pan(self, across: float, up: float, height: int) -> None:
        """Shift the picture by pixels to the right and upwards; it is `height` pixels high."""
        right, upward, _ = self.view().axes
        size = 2.0 * math.tan(math.radians(0.5 * self.field_of_view)) * self.distance / max(height, 1)
        self.target = self.target - size * (across * right + up * upward)

    def zoom(self, factor: float) -> None:
        """Change the distance by a factor."""
        self.distance = max(NEAREST, min(FARTHEST, self.distance * factor))

    def apply(self, renderer: pv.Renderer) -> None:
        """Make a renderer's camera this one."""
        view, camera = self.view(), renderer.GetActiveCamera()
        camera.SetPosition(*view.position)
        camera.SetFocalPoint(*view.target)
        camera.SetViewUp(*to_vector(view.axes[1]))
        camera.SetViewAngle(self.field_of_view)
        # Else PyVista looks from elsewhere when it shows the scene for the first time.
        renderer.camera_set = True
        renderer.ResetCameraClippingRange()
