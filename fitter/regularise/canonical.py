"""Parameters of a primitive that are nearly canonical made so, and its symmetries, as its family says.

Each change keeps the primitive's volume about where it was, so that it costs the objective little. Lengths are
normalised.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...kernels.primitives import family
from ...kernels.primitives.canonical_rules import Rule
from ...kernels.rotation import matrix_of
from ...kernels.rows import SHAPE, SHAPES, TRANSLATION


@dataclass(frozen=True)
class RowChange:
    """A rule, the value that it makes of a row's parameter, and the changed row (ROW,)."""

    rule: Rule
    value: float
    row: np.ndarray
    distance: float
    """How far the row was from it, in the unit of the rule's `rounding`."""


def shape_of(row: np.ndarray) -> np.ndarray:
    """The shape (SHAPE,) of a row (ROW,), a view."""
    return row[SHAPES : SHAPES + SHAPE]


def with_shape(row: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """The row (ROW,) with another shape (SHAPE,)."""
    changed = row.copy()
    changed[SHAPES : SHAPES + SHAPE] = shape
    return changed


def is_straight(row: np.ndarray, name: str, near: float = 0.0) -> bool:
    """Two-fold symmetry about z: True if half a turn takes the primitive to itself, or nearly so."""
    return family(name).holds(family(name).symmetries.half_turn_z, shape_of(row), near)


def turns_quarterly(row: np.ndarray, name: str) -> bool:
    """Four-fold symmetry about z: True if a quarter turn keeps the primitive, its sizes x and y swapped."""
    return family(name).holds(family(name).symmetries.quarter_turn_z, shape_of(row))


def is_prism(row: np.ndarray, name: str, near: float = 0.0) -> bool:
    """Two-fold symmetry about x, or nearly so: True if half a turn keeps it, top and bottom alike."""
    return family(name).holds(family(name).symmetries.half_turn_x, shape_of(row), near)


def is_round(row: np.ndarray, name: str, near: float = 0.0) -> bool:
    """Rotational symmetry: True for a body of revolution about its z axis."""
    return family(name).revolves(shape_of(row), near)


def is_box(row: np.ndarray, name: str) -> bool:
    """Interchangeable axes: True if all three are of one kind, so that sizes may change places."""
    return family(name).holds(family(name).symmetries.axis_order, shape_of(row))


def canonical_changes(row: np.ndarray, name: str) -> list[RowChange]:
    """Canonical changes of a row (ROW,), the most harmless first; each alone, from the row as it is."""
    entry, changes = family(name), []
    for rule in entry.rules:
        change = rule.change(entry, shape_of(row))
        if change is None:
            continue
        changed = with_shape(row, change.shape)
        if change.shift is not None:
            turn = matrix_of(row[TRANSLATION + 3 : TRANSLATION + 7])
            changed[TRANSLATION : TRANSLATION + 3] += (turn @ change.shift).astype(np.float32)
        changes.append(RowChange(rule, change.value, changed, change.distance))
    return changes
