"""Entries of parameter tables, and those that several families share."""

from __future__ import annotations

import math
from dataclasses import dataclass


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
        """How many numbers the entry has."""
        return len(self.default)


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
