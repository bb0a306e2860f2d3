"""What a primitive family is: its parameter table, its field and its GLSL text.

Everything that lists parameters (the JSON schema, sliders, the fitter's bounds, the docs) reads these tables.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..rows import SHAPE
from .canonical_rules import Rule
from .parameters import Parameter
from .swept_solids import SweptSolids, shapes_by_name

PointMap = Callable[[np.ndarray], np.ndarray]
"""Takes points (n, 3) to others."""
Turned = tuple[np.ndarray, tuple[int, int, int] | None]
"""A shape (SHAPE,), and which of the old axes its x, y and z are; None where they stay."""


Box = tuple[np.ndarray, np.ndarray]
"""Lowest and highest corner, each (3,) float64."""

Values = Mapping[str, float | tuple[float | None, ...]]
"""Parameters by name and the values that they must have; None in a tuple is any value."""


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
class Family:
    """A kind of primitive: all that the rest of the package knows of it. Points are in the primitive's local frame.

    Functions of a table are Warp functions, functions of a shape (SHAPE,) are Python. What has no default must be
    written; tests/kernels/primitives/test_family_contract.py checks every promise that is made here.
    """

    name: str
    description: str
    parameters: tuple[Parameter, ...]
    """At most SHAPE numbers in all. Those of unit "length", and they alone, scale with the frame. `size`, where there
    is one, comes first: three full extents along the axes, which editors stretch."""
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
    starts: Callable[[Family, SweptSolids], tuple[np.ndarray, np.ndarray]] = shapes_by_name
    """(family, solids) -> shapes (g, SHAPE) that are nearest to them, and whether (g,) they are near."""
    symmetries: Symmetries = Symmetries()
    rules: tuple[Rule, ...] = ()
    """What may be made canonical, the most harmless first."""
    without_extent: Callable[[Family, np.ndarray], Turned] | None = None
    """(family, shape) -> the shape whose thin extents are none, and the columns of its axes."""
    flat_ended: Callable[[Family, np.ndarray], np.ndarray] | None = None
    """(family, shape) -> the shape with flat ends in place of round ones, the same where it has none."""
    index: int = field(default=-1)
    """Place in the registry: the package's own in alphabetical order, then the others."""

    @property
    def parameter_count(self) -> int:
        """Numbers in a row's shape that this family uses, at most SHAPE."""
        return sum(parameter.count for parameter in self.parameters)

    def columns(self, name: str) -> slice:
        """Where the parameter `name` lies in the shape part of a row."""
        begin = 0
        for parameter in self.parameters:
            if parameter.name == name:
                return slice(begin, begin + parameter.count)
            begin += parameter.count
        raise KeyError(name)

    @property
    def lengths(self) -> list[int]:
        """Columns of the shape that scale with the frame."""
        of_unit = (self.columns(entry.name) for entry in self.parameters if entry.unit == "length")
        return [column for columns in of_unit for column in range(columns.start, columns.stop)]

    @property
    def sides(self) -> list[int]:
        """Columns of the shape that tell how large it is: those of `size`, else all lengths."""
        columns = self.columns("size") if self.has("size") else None
        return self.lengths if columns is None else list(range(columns.start, columns.stop))

    def has(self, *names: str) -> bool:
        """Whether it has parameters of these names."""
        return all(any(parameter.name == name for parameter in self.parameters) for name in names)

    def value(self, shape: np.ndarray, name: str, otherwise: float) -> float:
        """The first number of a parameter of a shape (SHAPE,); `otherwise` where there is none of that name."""
        return float(shape[self.columns(name).start]) if self.has(name) else otherwise

    def with_values(self, shape: np.ndarray, values: Values | None) -> np.ndarray:
        """The shape (SHAPE,) with parameters set."""
        changed = shape.copy()
        for column, value in self._wanted(values or {}):
            changed[column] = value
        return changed

    def holds(self, values: Values | None, shape: np.ndarray, near: float = 0.0) -> bool:
        """Whether the parameters of a shape (SHAPE,) have these values, but for `near`; never for None."""
        if values is None:
            return False
        return all(abs(float(shape[column]) - value) <= near for column, value in self._wanted(values))

    def revolves(self, shape: np.ndarray, near: float = 0.0) -> bool:
        """Whether the shape (SHAPE,) is a body of revolution about z, but for `near`."""
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

    def _wanted(self, values: Values) -> Iterator[tuple[int, float]]:
        """Columns and the values in them."""
        for name, value in values.items():
            first = self.columns(name).start
            for k, number in enumerate(value if isinstance(value, tuple) else (value,)):
                if number is not None:
                    yield first + k, number

    def shape_row(self, **values: Any) -> np.ndarray:
        """Shape part (SHAPE,) float32 of a row with the given parameters, defaults elsewhere."""
        row = np.zeros(SHAPE, np.float32)
        for parameter in self.parameters:
            row[self.columns(parameter.name)] = values.pop(parameter.name, parameter.default)
        if values:
            raise KeyError(f"{self.name} has no parameter {', '.join(values)}")
        return row

    def _ranges(self, which: str) -> tuple[np.ndarray, np.ndarray]:
        low, high = np.zeros(SHAPE, np.float32), np.zeros(SHAPE, np.float32)
        for parameter in self.parameters:
            low[self.columns(parameter.name)], high[self.columns(parameter.name)] = getattr(parameter, which)
        return low, high

    @property
    def legal_range(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest legal shape, each (SHAPE,); 0 in unused columns."""
        return self._ranges("legal")

    @property
    def fit_range(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest fitted shape, each (SHAPE,); 0 in unused columns."""
        return self._ranges("fit")

    def to_valid(self, raw: np.ndarray) -> np.ndarray:
        """Shapes (..., SHAPE) from unbounded raw numbers: low + (high - low) * logistic(raw)."""
        low, high = self.fit_range
        return low + (high - low) / (1.0 + np.exp(-raw))

    def to_raw(self, shape: np.ndarray) -> np.ndarray:
        """Inverse of `to_valid`; shares of the range are kept in [1e-4, 1 - 1e-4], where the slope is not dead."""
        low, high = self.fit_range
        share = np.clip((shape - low) / np.where(high > low, high - low, 1.0), 1e-4, 1.0 - 1e-4)
        return np.where(high > low, np.log(share / (1.0 - share)), 0.0)
