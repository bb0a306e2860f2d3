"""Between the mesh's own frame and the normalised frame in which everything is fitted and stored.

`mesh = scale * normalised + translation`. Points are moved in float64, before anything becomes float32: a
unit-sized mesh a million units from the origin then loses nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from resfit.errors import AssemblyError, InputError

NORMALISED_SIDE = 1.8
"""Longest side of the bounding box in the normalised frame: in [-1, 1]^3, with room around it."""

Z_UP_SUFFIXES = (".stl", ".3mf", ".off", ".step", ".stp")
"""Formats of CAD, where z points up; in glTF and most others it is y. Only pictures depend on it."""

FAR_RADIUS = 1e4
"""From here the unit cube is a point to float32: seen from farther away it only gets more distant."""


def up_axis(name: str) -> Literal["y", "z"]:
    """The axis that points up in pictures, by the name of the input's file."""
    return "z" if name.lower().endswith(Z_UP_SUFFIXES) else "y"


@dataclass(frozen=True)
class Transform:
    """Scale and translation that take normalised points to the mesh's frame.

    Raises:
        AssemblyError: if the scale is not finite and above 0, or the translation not finite.
    """

    scale: float = 1.0
    """[mesh units per normalised unit]"""
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the normalised origin lies, [mesh units]."""

    def __post_init__(self) -> None:
        scale = float(self.scale)
        if not (math.isfinite(scale) and scale > 0.0):
            raise AssemblyError(f"transform.scale is {scale:g}; it must be a finite number above 0")
        x, y, z = (float(value) + 0.0 for value in self.translation)
        if not all(math.isfinite(value) for value in (x, y, z)):
            raise AssemblyError("transform.translation must be three finite numbers")
        object.__setattr__(self, "scale", scale)
        object.__setattr__(self, "translation", (x, y, z))

    @classmethod
    def from_bounds(cls, lower: npt.ArrayLike, upper: npt.ArrayLike) -> Transform:
        """The transform that centres a box and makes its longest side NORMALISED_SIDE.

        Args:
            lower, upper: opposite corners, (3,), mesh units.

        Raises:
            InputError: if the box is a single point, or a corner is not finite.
        """
        low, high = np.asarray(lower, np.float64), np.asarray(upper, np.float64)
        if low.shape != (3,) or high.shape != (3,) or not np.isfinite([low, high]).all():
            raise InputError("the bounding box has coordinates that are not finite numbers")
        # Halves first: the sum or difference of two large corners may overflow.
        centre = low / 2.0 + high / 2.0
        scale = float(np.max(high / 2.0 - low / 2.0)) / (NORMALISED_SIDE / 2.0)
        if not (scale > 0.0 and math.isfinite(scale)):
            raise InputError("the bounding box has no extent: there is no shape in it")
        return cls(scale, (float(centre[0]), float(centre[1]), float(centre[2])))

    def to_normalised(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Points (n, 3) in mesh units, as points (n, 3) float64 in the normalised frame."""
        return (as_points(points) - np.asarray(self.translation)) / self.scale

    def to_mesh(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Points (n, 3) in the normalised frame, as points (n, 3) float64 in mesh units; infinite where too large."""
        with np.errstate(over="ignore"):
            return as_points(points) * self.scale + np.asarray(self.translation)

    def to_field(self, points: npt.ArrayLike) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float64]]:
        """Field arguments for `points` (n, 3) in mesh units, and what to add to the distances.

        Returns:
            points (n, 3) float32 in the normalised frame, none farther out than FAR_RADIUS (much farther,
            float32 overflows in the field); and (n,) float64, how much farther out the given points are.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            local = self.to_normalised(points)
            radius = np.maximum(np.abs(local).max(axis=1, initial=0.0), 1e-300)
            shrunk = np.minimum(1.0, FAR_RADIUS / radius)
            beyond = (1.0 - shrunk) * np.linalg.norm(local / radius[:, None], axis=1) * radius
            return (local * shrunk[:, None]).astype(np.float32), beyond

    def to_mesh_distance(
        self, distance: npt.NDArray[Any], beyond: float | npt.NDArray[Any] = 0.0
    ) -> npt.NDArray[np.float32]:
        """Signed distances (..., n) in the normalised frame plus `beyond` (n,), in mesh units, float32."""
        with np.errstate(over="ignore", under="ignore"):
            return ((distance.astype(np.float64) + beyond) * self.scale).astype(np.float32)


def as_points(points: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """`points` as float64 (n, 3).

    Raises:
        InputError: if they are not numbers, or not three a row.
    """
    try:
        array = np.asarray(points, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError("points must be an array of numbers, shape (n, 3)") from error
    if array.size == 0 and array.ndim < 2:
        return np.zeros((0, 3))
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"points must have shape (n, 3), not {array.shape}")
    return array
