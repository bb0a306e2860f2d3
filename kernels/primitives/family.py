"""What a primitive family is: its parameter table, its field and its GLSL text.

Everything that lists parameters (the JSON schema, sliders, the fitter's bounds, the docs) reads these tables.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..rows import SHAPE


@dataclass(frozen=True)
class Parameter:
    """One named entry of a family's table; `count` numbers that share unit and ranges."""

    name: str
    description: str
    unit: str
    """"length" (normalised units) or "ratio"."""
    legal: tuple[float, float]
    """Closed range of what is valid; wider than what is fitted."""
    fit: tuple[float, float]
    """Open range that `to_valid` covers (superfrustum.md, "Parameters and ranges")."""
    default: tuple[float, ...]
    slider: tuple[float, float]
    """Range an editor offers."""

    @property
    def count(self) -> int:
        """How many numbers the entry has."""
        return len(self.default)


@dataclass(frozen=True)
class Family:
    """A kind of primitive. Functions are Warp functions; points are in the primitive's local frame."""

    name: str
    description: str
    parameters: tuple[Parameter, ...]
    table: Any
    """`wp.struct` with everything the field needs that does not depend on the point."""
    derive: Any
    """(rows, base) -> table, from the row that starts at `base` of the flat rows."""
    sdf: Any
    """(table, x, y, z) -> signed distance, negative inside."""
    reach: Any
    """(table, x, y, z, radius) -> the most that the field can change within `radius` of the point."""
    glsl: str
    """GLSL ES 3.00 text of the function `float sdf_<name>(vec3 p, float s[8])`."""
    fast: Any = None
    """(table, x, y, z) -> the same field, cheaper, valid in blocks of points where `seam_zone` is nowhere above 0."""
    seam_zone: Any = None
    """(table, x, y, z) -> above 0 where only `sdf` is right."""
    sdf_grad: Any = None
    """(table, x, y, z) -> distance, 3 derivatives to the point, SHAPE to the parameters; from `<name>_gradient.py`."""
    fast_grad: Any = None
    """The same for `fast`."""
    approximate: bool = False
    """The field is not a distance away from the surface: say so wherever it shows."""
    index: int = field(default=-1)
    """Place among the families in alphabetical order, given by the registry."""

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


LENGTH_MAX = 3.2
"""No extent in the normalised frame exceeds this: a turned rod may be as long as the diagonal of the cube."""


def size_parameter(description: str = "full extents; z is the sweep axis") -> Parameter:
    """The entry that all families begin with."""
    return Parameter(
        "size", description, "length", (0.0, math.inf), (1e-3, LENGTH_MAX), (0.5, 0.5, 0.5), (0.0, 2.0)
    )


def dilation_parameter() -> Parameter:
    """The offset of the whole field: rounds every convex edge."""
    return Parameter(
        "dilation",
        "offset of the surface; rounds every convex edge",
        "length",
        (0.0, math.inf),
        (0.0, 1.0),
        (0.0,),
        (0.0, 1.0),
    )


def roundness_parameter() -> Parameter:
    """The corner radius of a profile."""
    return Parameter(
        "roundness",
        "corner radius of the profile as a share of its inset radius; 1 is a stadium or disc",
        "ratio",
        (0.0, 1.0),
        (0.0, 1.0),
        (0.0,),
        (0.0, 1.0),
    )


def onion_parameter() -> Parameter:
    """The hole of a profile; below 0 it only makes inner distances exact (superfrustum.md, "Trapezoid and onion")."""
    return Parameter(
        "onion",
        "hole relative to the profile's inset; above 0 hollow, -1 solid with exact inner distances",
        "ratio",
        (-1.0, 1.0),
        (-1.0, 1.0),
        (-1.0,),
        (-1.0, 1.0),
    )
