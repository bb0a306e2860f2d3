"""Parameters of a primitive that are nearly canonical made so: straight, prismatic, solid, sharp, round, square.

Each change keeps the primitive's volume about where it was, so that it costs the objective little. Lengths are
normalised.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...kernels.primitives import family
from ...kernels.rotation import matrix_of
from ...kernels.rows import SHAPES, TRANSLATION

NEAR_BULGE = 0.06
"""A quarter of a turn is 1: an arc of 5 degrees is nearly straight."""
NEAR_TAPER = 0.1
NEAR_ROUNDNESS = 0.15
NEAR_SQUARE = 0.06
"""Relative difference of the two sides of a profile."""
NEAR_SHARP = 0.03
"""Dilation that is tried without, normalised: 1.7 % of the longest side."""
NEAR_SOLID = 0.1
"""Onion up to which a hole is tried closed; up to 0 there is none, and the surface stays as it is."""

Change = tuple[str, float, np.ndarray]
"""Parameter, its new value, and the changed row (ROW,)."""


def parameter_of(row: np.ndarray, name: str, parameter: str, default: float) -> float:
    """A parameter of a row (ROW,) of family `name`, its first number; `default` where the family has none."""
    entry = family(name)
    if not any(found.name == parameter for found in entry.parameters):
        return default
    return float(row[SHAPES + entry.columns(parameter).start])


def with_parameter(row: np.ndarray, name: str, parameter: str, value: float) -> np.ndarray:
    """The row with a parameter changed, as it is where the family has none."""
    entry = family(name)
    changed = row.copy()
    if any(found.name == parameter for found in entry.parameters):
        changed[SHAPES + entry.columns(parameter).start] = value
    return changed


def is_straight(row: np.ndarray, name: str, near: float = 0.0) -> bool:
    """Whether the sweep is not bent, or by less than `near`."""
    return abs(parameter_of(row, name, "bulge", 0.0)) <= near


def is_prism(row: np.ndarray, name: str, near: float = 0.0) -> bool:
    """Whether top and bottom are alike, or differ in taper by less than `near`."""
    return abs(parameter_of(row, name, "taper", 1.0) - 1.0) <= near


def is_round(row: np.ndarray, name: str, near: float = 0.0) -> bool:
    """Whether the primitive is a body of revolution about its z axis."""
    x, y = row[SHAPES : SHAPES + 2]
    exponents = parameter_of(row, name, "exponents", -1.0)
    if exponents >= 0.0:
        across = float(row[SHAPES + family(name).columns("exponents").start + 1])
        return abs(x - y) <= near * max(x, y) and abs(across - 1.0) <= near
    roundness = parameter_of(row, name, "roundness", 0.0)
    return is_straight(row, name, near) and abs(x - y) <= near * max(x, y) and roundness >= 1.0 - near


def is_box(row: np.ndarray, name: str) -> bool:
    """Whether all three axes are of one kind, so that sizes may change places."""
    if name == "cuboid":
        return True
    sharp = parameter_of(row, name, "roundness", 1.0) == 0.0
    solid = parameter_of(row, name, "onion", 0.0) == -1.0
    return name != "superquadric" and sharp and solid and is_straight(row, name) and is_prism(row, name)


def canonical_changes(row: np.ndarray, name: str) -> list[Change]:
    """What may be made canonical in a row (ROW,), the most harmless first; each alone, from the row as it is."""
    makers: list[Callable[[np.ndarray, str], Change | None]] = [
        _solid,
        _straight,
        _prism,
        _sharp,
        _profile,
        _square,
    ]
    return [change for maker in makers if (change := maker(row, name)) is not None]


def _solid(row: np.ndarray, name: str) -> Change | None:
    onion = parameter_of(row, name, "onion", -1.0)
    return ("onion", -1.0, with_parameter(row, name, "onion", -1.0)) if -1.0 < onion < NEAR_SOLID else None


def _straight(row: np.ndarray, name: str) -> Change | None:
    bulge = parameter_of(row, name, "bulge", 0.0)
    if bulge == 0.0 or abs(bulge) > NEAR_BULGE:
        return None
    changed = with_parameter(row, name, "bulge", 0.0)
    # The arc's middle lies to one side of the chord; two thirds of that is its mean.
    sag = 0.5 * float(row[SHAPES + 2]) * np.tan(0.25 * np.pi * bulge)
    turn = matrix_of(row[TRANSLATION + 3 : TRANSLATION + 7])
    changed[TRANSLATION : TRANSLATION + 3] += (turn[:, 0] * (-2.0 / 3.0 * sag)).astype(np.float32)
    return "bulge", 0.0, changed


def _prism(row: np.ndarray, name: str) -> Change | None:
    taper = parameter_of(row, name, "taper", 1.0)
    if taper == 1.0 or abs(taper - 1.0) > NEAR_TAPER:
        return None
    changed = with_parameter(row, name, "taper", 1.0)
    # The mean of bottom and top: they differ by twice the change of the inset.
    narrow = 0.5 * (1.0 - taper) * float(row[SHAPES : SHAPES + 2].min())
    changed[SHAPES : SHAPES + 2] = np.maximum(row[SHAPES : SHAPES + 2] - narrow, 1e-4)
    return "taper", 1.0, changed


def _sharp(row: np.ndarray, name: str) -> Change | None:
    dilation = parameter_of(row, name, "dilation", 0.0)
    if not 0.0 < dilation <= NEAR_SHARP or parameter_of(row, name, "onion", -1.0) > 0.0:
        return None
    changed = with_parameter(row, name, "dilation", 0.0)
    changed[SHAPES : SHAPES + 3] += 2.0 * dilation
    return "dilation", 0.0, changed


def _profile(row: np.ndarray, name: str) -> Change | None:
    roundness = parameter_of(row, name, "roundness", 0.0)
    for value in (0.0, 1.0):
        if 0.0 < abs(roundness - value) <= NEAR_ROUNDNESS:
            return "roundness", value, with_parameter(row, name, "roundness", value)
    return None


def _square(row: np.ndarray, name: str) -> Change | None:
    x, y = (float(value) for value in row[SHAPES : SHAPES + 2])
    if x == y or abs(x - y) > NEAR_SQUARE * max(x, y):
        return None
    changed = row.copy()
    changed[SHAPES : SHAPES + 2] = 0.5 * (x + y)
    return "square", 0.5 * (x + y), changed
