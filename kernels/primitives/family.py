"""Interface of a primitive family: all that the rest of the package knows of a kind of primitive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .canonical_rules import Rule
from .dilated import Turned
from .parameters import ParameterTable, Values
from .swept_solids import SweptSolids, shapes_by_name

PointMap = Callable[[np.ndarray], np.ndarray]
"""Takes points (n, 3) to others."""


Box = tuple[np.ndarray, np.ndarray]
"""Lowest and highest corner, each (3,) float64."""


@dataclass(frozen=True)
class Symmetries:
    """Rotations that take a primitive to itself, each with the values that its parameters must have; None is never.

    Beside these every family is its own mirror image in the local plane y = 0.
    """

    half_turn_z: Values | None = None
    half_turn_x: Values | None = None
    quarter_turn_z: Values | None = None
    """Where the numbers of `size` for x and y change places."""
    axis_order: Values | None = None
    """Any rotation of the cube, where the numbers of `size` change places with their axes."""
    revolution: Values | None = None
    """Any turn about z, where the numbers of `size` for x and y are equal."""


@dataclass(frozen=True)
class Family(ParameterTable):
    """A kind of primitive: all that the rest of the package knows of it. Points are in the primitive's local frame.

    Functions of a table are Warp functions, functions of a shape (SHAPE,) are Python. What has no default must be
    written; tests/kernels/primitives/test_family_contract.py checks every promise that is made here.
    """

    table: Any
    """`wp.struct` with everything the field needs that does not depend on the point."""
    derive: Any
    """(rows, base) -> table, from the row that starts at `base` of the flat rows."""
    sdf: Any
    """(table, x, y, z) -> signed distance, negative inside."""
    sdf_grad: Any
    """(table, x, y, z) -> Derivatives: distance, 3 derivatives to the point, SHAPE to the parameters."""
    reach: Any
    """(table, x, y, z, radius) -> the most that the field can change within `radius` of the point."""
    glsl: str
    """GLSL ES 3.00 text of the function `float sdf_<name>(vec3 p, float s[8])`."""
    bounds: Callable[[np.ndarray], Box]
    """shape -> box that holds the surface."""
    javascript: str
    """Object with the function `bounds(parameters)`, which gives [low, high], and where steps are not the whole
    distance `stepping(parameters)` (exports/page/spheres.js)."""
    fast: Any = None
    """(table, x, y, z) -> the same field, cheaper, valid in blocks of points where `seam_zone` is nowhere above 0."""
    fast_grad: Any = None
    """The derivatives of `fast`."""
    seam_zone: Any = None
    """(table, x, y, z) -> above 0 where only `sdf` is right."""
    approximate: bool = False
    """The field is not a distance away from the surface: say so wherever it shows."""
    slope: Callable[[np.ndarray], float] = lambda shape: 1.0
    """shape -> Lipschitz constant of the field, but for few points."""
    step: Callable[[np.ndarray], float] = lambda shape: 1.0
    """shape -> share of the field's value after which, but for few points, a ray is before the surface or inside."""
    walls: Callable[[np.ndarray], np.ndarray] | None = None
    """shape -> thickness (3,) of the thinnest wall along each axis; the box's sides unless given."""
    straightened: Callable[[np.ndarray], tuple[np.ndarray, PointMap] | None] = lambda shape: None
    """shape -> another that is easier to mesh, and the map of its surface's points (n, 3) to this one's; or None."""
    mesh: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]] | None = None
    """shape -> vertices and faces of its surface, where that is known in closed form."""
    starts: Callable[[ParameterTable, SweptSolids], tuple[np.ndarray, np.ndarray]] = shapes_by_name
    """(family, solids) -> shapes (g, SHAPE) that are nearest to them, and whether (g,) they are near."""
    symmetries: Symmetries = Symmetries()
    rules: tuple[Rule, ...] = ()
    """What may be made canonical, the most harmless first."""
    without_extent: Callable[[ParameterTable, np.ndarray], Turned] | None = None
    """(family, shape) -> the shape whose thin extents are none, and the columns of its axes."""
    flat_ended: Callable[[ParameterTable, np.ndarray], np.ndarray] | None = None
    """(family, shape) -> the shape with flat ends in place of round ones, the same where it has none."""
    index: int = field(default=-1)
    """Place in the registry: the package's own in alphabetical order, then the others."""

    def revolves(self, shape: np.ndarray, near: float = 0.0) -> bool:
        """True if the shape (SHAPE,) is a solid of revolution about z, but for `near`."""
        if self.has("size"):
            x, y = shape[self.columns("size")][:2]
            if abs(x - y) > near * max(x, y):
                return False
        return self.holds(self.symmetries.revolution, shape, near)

    def extents(self, shapes: np.ndarray) -> np.ndarray:
        """Extents (n, 3) of shapes (n, SHAPE) along their axes, to compare them by: `size`, else those of the box."""
        if self.has("size"):
            return shapes[:, self.columns("size")]
        boxes = [self.bounds(shape) for shape in shapes]
        return np.array([high - low for low, high in boxes], np.float32).reshape(-1, 3)
