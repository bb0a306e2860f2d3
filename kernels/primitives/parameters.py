"""Entries of parameter tables, and those that several families share."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
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
    typical: tuple[float, float] | None = None
    """Range of usual values, for random scenes; the legal one unless given."""

    @property
    def count(self) -> int:
        """Number of components of the entry."""
        return len(self.default)


Values = Mapping[str, float | tuple[float | None, ...]]
"""Parameters by name and the values that they must have; None in a tuple is any value."""


@dataclass(frozen=True)
class ParameterTable:
    """The parameters of a family: what the numbers of a shape (SHAPE,) mean.

    Everything that lists parameters (the JSON schema, sliders, the fitter's ranges) reads this.
    """

    name: str
    description: str
    parameters: tuple[Parameter, ...]
    """At most SHAPE numbers in all. Those of unit "length", and they alone, scale with the frame. `size`, where there
    is one, comes first: three full extents along the axes, which editors stretch."""

    @property
    def parameter_count(self) -> int:
        """Numbers in a row's shape that this family uses, at most SHAPE."""
        return sum(parameter.count for parameter in self.parameters)

    def columns(self, name: str) -> slice:
        """Columns of the parameter `name` in the shape part of a row."""
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
        """True if it has parameters of these names."""
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
        """True if the parameters of a shape (SHAPE,) have these values, but for `near`; never for None."""
        if values is None:
            return False
        return all(abs(float(shape[column]) - value) <= near for column, value in self._wanted(values))

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


LENGTH_MAX = 3.2
"""No extent in the normalised frame exceeds this: a turned rod may be as long as the diagonal of the cube."""


def size_parameter(description: str = "full extents; z is the sweep axis") -> Parameter:
    """The entry that all families begin with."""
    return Parameter(
        "size",
        description,
        "length",
        (0.0, math.inf),
        (1e-3, LENGTH_MAX),
        (0.5, 0.5, 0.5),
        (0.0, 2.0),
        (0.1, 0.6),
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
        (0.0, 0.05),
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
