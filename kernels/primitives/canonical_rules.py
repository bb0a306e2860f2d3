"""Rules by which nearly canonical parameters become canonical: solid, prismatic, sharp, round or square.

A rule keeps the primitive's volume about where it was, so that it costs the objective little. Lengths are normalised.
Rules of one family alone stand in that family's file.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .parameters import ParameterTable

NEAR_TAPER = 0.1
NEAR_ROUNDNESS = 0.15
NEAR_SQUARE = 0.06
"""Relative difference of the two sides of a profile."""
NEAR_SHARP = 0.03
"""Dilation that is tried without, normalised: 1.7 % of the longest side."""
NEAR_SOLID = 0.1
"""Onion up to which a hole is tried closed; up to 0 there is none, and the surface stays as it is."""


class Change(NamedTuple):
    """A canonical value, and the shape that has it."""

    value: float
    shape: np.ndarray
    """(SHAPE,) float32."""
    distance: float
    """How far the shape was from it, in the unit of the rule's `rounding`."""
    shift: np.ndarray | None = None
    """(3,), what the primitive's centre moves by in its local frame."""


@dataclass(frozen=True)
class Rule:
    """Rule for one value of a shape that may become canonical."""

    name: str
    """The parameter; or another word where `impose` and `read` are given."""
    rounding: float
    """Distance up to which the value is taken to be canonical but for rounding."""
    change: Callable[[ParameterTable, np.ndarray], Change | None]
    """(family, shape) -> what would change; None where nothing is near enough, or all is canonical."""
    imposed: Callable[[ParameterTable, np.ndarray], np.ndarray] | None = None
    read: Callable[[ParameterTable, np.ndarray], float] | None = None

    def impose(self, family: ParameterTable, shape: np.ndarray, value: float) -> np.ndarray:
        """The shape with the canonical value, however far it is from that, and nothing else changed."""
        return self.imposed(family, shape) if self.imposed else family.with_values(shape, {self.name: value})

    def value(self, family: ParameterTable, shape: np.ndarray) -> float:
        """The number that the rule made canonical."""
        return self.read(family, shape) if self.read else family.value(shape, self.name, 0.0)


def _solid(family: ParameterTable, shape: np.ndarray) -> Change | None:
    onion = family.value(shape, "onion", -1.0)
    if not -1.0 < onion < NEAR_SOLID:
        return None
    return Change(-1.0, family.with_values(shape, {"onion": -1.0}), max(0.0, onion))


def _prism(family: ParameterTable, shape: np.ndarray) -> Change | None:
    taper = family.value(shape, "taper", 1.0)
    if taper == 1.0 or abs(taper - 1.0) > NEAR_TAPER:
        return None
    changed, profile = family.with_values(shape, {"taper": 1.0}), shape[family.columns("size")][:2]
    # The mean of bottom and top: they differ by twice the change of the inset.
    narrow = 0.5 * (1.0 - taper) * float(profile.min())
    changed[family.columns("size")][:2] = np.maximum(profile - narrow, 1e-4)
    # What dilation makes thick tapers less than its profile does.
    width = float(profile.max())
    thick = width + 2.0 * family.value(shape, "dilation", 0.0)
    return Change(1.0, changed, abs(taper - 1.0) * width / thick)


def _sharp(family: ParameterTable, shape: np.ndarray) -> Change | None:
    dilation = family.value(shape, "dilation", 0.0)
    if not 0.0 < dilation <= NEAR_SHARP or family.value(shape, "onion", -1.0) > 0.0:
        return None
    changed = family.with_values(shape, {"dilation": 0.0})
    changed[family.columns("size")] += 2.0 * dilation
    return Change(0.0, changed, dilation)


def _profile(family: ParameterTable, shape: np.ndarray) -> Change | None:
    roundness = family.value(shape, "roundness", 0.0)
    for value in (0.0, 1.0):
        if 0.0 < abs(roundness - value) <= NEAR_ROUNDNESS:
            return Change(value, family.with_values(shape, {"roundness": value}), abs(roundness - value))
    return None


def _square(family: ParameterTable, shape: np.ndarray) -> Change | None:
    x, y = (float(value) for value in shape[family.columns("size")][:2])
    if x == y or abs(x - y) > NEAR_SQUARE * max(x, y):
        return None
    changed = shape.copy()
    changed[family.columns("size")][:2] = 0.5 * (x + y)
    return Change(0.5 * (x + y), changed, abs(x - y) / max(x, y))


def _made_square(family: ParameterTable, shape: np.ndarray) -> np.ndarray:
    changed = shape.copy()
    sides = changed[family.columns("size")][:2]
    sides[:] = sides.mean()
    return changed


SOLID = Rule("onion", 0.0, _solid)
PRISM = Rule("taper", 0.015, _prism)
SHARP = Rule("dilation", 2e-3, _sharp)
PROFILE = Rule("roundness", 0.03, _profile)
SQUARE = Rule(
    "square", 0.01, _square, _made_square, lambda family, shape: float(shape[family.columns("size").start])
)
"""The two sides of a profile become equal."""
