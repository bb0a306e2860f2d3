"""The standard form of each primitive: parameters that are canonical but for rounding made exactly so.

A ball, a capsule and a ring may be shapes without extent that dilation makes thick: fitting ends a little beside them,
where sizes are nearly 0 and other parameters mean nothing. Lengths are normalised.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from ...kernels.primitives import family
from ...kernels.rotation import matrix_of, multiply, quaternion_of
from ...kernels.rows import ROTATION, SHAPES, TRANSLATION
from ..objective.cached import CachedObjective
from .canonical import (
    canonical_changes,
    is_box,
    is_prism,
    is_round,
    is_straight,
    shape_of,
    turns_quarterly,
    with_shape,
)
from .constraints import Constraints, Copied, tidy, turn_between
from .rigid_motion import canonical_sign
from .snap_axes import ROTATIONS

COSTLESS = 2e-5
"""Most that the objective may fall for one part: about the weight of one sample point."""

SIMPLER = 1e-3
"""The same where a part becomes a ball, a capsule or a ring: half its price for half its numbers."""

COARSE = 0.01
"""And where the surface moves by less than it is off the target's anyway, as on a coarse ball of facets."""

MOST_SHIFT = 3e-4
"""Mean distance that a surface may move at any cost: a fiftieth of a cell, far below what the grid measures. Fits of
plain shapes are so exact that samples within 1e-5 of the surface change sides, and the objective with them."""

NEAR_SURFACE = 0.02
"""Samples this near to a surface tell how it moves."""

TUNING = (4e-4, 1e-4, 2.5e-5)
"""Steps of lengths when a primitive without extent is moved to where it is best: gradients end beside it."""


def standard_forms(
    rows: np.ndarray, cached_objective: CachedObjective, copies: Sequence[Copied] = ()
) -> np.ndarray:
    """Rows in which each primitive has its standard form, as far as that leaves the objective as it is.

    Args:
        rows: (primitive_count, ROW) float32.
        cached_objective: of the target.
        copies: primitives that follow from others; they stay so.
    """
    form = _Forms(rows, cached_objective, Constraints(tuple(copies)))
    for index in form.constraints.free(len(rows)):
        name = form.families[index]
        form.attempt(index, _canonical(form.rows[index], name))
        bare = _without_extent(form.rows[index], name)
        if not np.array_equal(bare, form.rows[index]):
            form.attempt(index, _tuned(bare, name, partial(form.objective_with, index)), SIMPLER)
        flat = _flat_ended(form.rows[index], name)
        if not np.array_equal(flat, form.rows[index]):
            form.attempt(index, _tuned(flat, name, partial(form.objective_with, index)), 0.0)
        form.attempt(index, _plainest_pose(form.rows[index], name))
    return form.rows


class _Forms:
    """Rows that are being changed, as long as neither their objective nor their surface changes to speak of."""

    def __init__(self, rows: np.ndarray, cached_objective: CachedObjective, constraints: Constraints):
        self.rows, self.cached_objective, self.constraints = rows, cached_objective, constraints
        self.families = cached_objective.families(rows)
        self.objective = cached_objective.objective(rows) if len(rows) else 0.0

    def changed(self, index: int, row: np.ndarray) -> np.ndarray:
        rows = self.rows.copy()
        rows[index] = row
        return self.constraints.complete(rows, self.families)

    def objective_with(self, index: int, row: np.ndarray) -> float:
        return self.cached_objective.objective(self.changed(index, row))

    def attempt(self, index: int, row: np.ndarray, fall: float = COSTLESS) -> None:
        """Take a row if the objective falls by no more than `fall`, or the surface hardly moves."""
        if np.array_equal(row, self.rows[index]):
            return
        rows = self.changed(index, row)
        objective = self.cached_objective.objective(rows)
        if objective < self.objective - fall:
            shift, misfit = self._shift(index, row)
            coarse = objective >= self.objective - COARSE and shift <= misfit
            if fall <= 0.0 or (shift > MOST_SHIFT and not (fall > COSTLESS and coarse)):
                return
        self.rows, self.objective = rows, objective

    def _shift(self, index: int, row: np.ndarray) -> tuple[float, float]:
        """Mean distances by which a primitive's surface moves, and is off the target's, at samples near it."""
        before, after = self.cached_objective.values(np.stack([self.rows[index], row]))
        near = np.abs(before) < NEAR_SURFACE
        if not near.any():
            return 0.0, 0.0
        off = before[near] - self.cached_objective.samples.distance[near]
        return float(np.abs(after - before)[near].mean()), float(np.abs(off).mean())


def _tuned(row: np.ndarray, name: str, objective: Callable[[np.ndarray], float]) -> np.ndarray:
    """The row with its lengths that are not 0, and its place, moved one by one to where the objective is highest."""
    entry, best = family(name), objective(row)
    lengths = [np.array([SHAPES + column]) for column in entry.lengths]
    if entry.has("size") and row[SHAPES] == row[SHAPES + 1]:
        # Of a ring both sides of the profile are one diameter.
        lengths[:2] = [np.concatenate(lengths[:2])]
    lengths = [columns for columns in lengths if (row[columns] > 0.0).all()]
    place = list(TRANSLATION + np.arange(3)[:, None])
    for step in TUNING:
        for columns in (*lengths, *place):
            for direction in (step, -step):
                while columns[0] < SHAPES or (row[columns] > step).all():
                    moved = row.copy()
                    moved[columns] += direction
                    found = objective(moved)
                    if found <= best:
                        break
                    row, best = moved, found
    return row


def _without_extent(row: np.ndarray, name: str) -> np.ndarray:
    """A row whose thin sizes, and a thin wall, are none: dilation takes their place."""
    entry = family(name)
    if entry.without_extent is None:
        return row
    shape, axes = entry.without_extent(entry, shape_of(row))
    changed = with_shape(row, shape)
    if axes is not None:
        own = row[ROTATION : ROTATION + 4].astype(np.float64)
        changed[ROTATION : ROTATION + 4] = multiply(own, quaternion_of(np.eye(3)[:, axes]))
    return changed


def _flat_ended(row: np.ndarray, name: str) -> np.ndarray:
    """The row with flat ends in place of round ones: a thin rod ends as one or the other."""
    entry = family(name)
    return row if entry.flat_ended is None else with_shape(row, entry.flat_ended(entry, shape_of(row)))


def _canonical(row: np.ndarray, name: str) -> np.ndarray:
    """A row with every parameter canonical that is so but for rounding."""
    tried: set[tuple[str, float]] = set()
    while True:
        fresh = next(
            (
                change
                for change in canonical_changes(row, name)
                if (change.rule.name, change.value) not in tried and change.distance <= change.rule.rounding
            ),
            None,
        )
        if fresh is None:
            return row
        row = fresh.row
        tried.add((fresh.rule.name, fresh.value))


def _plainest_pose(row: np.ndarray, name: str) -> np.ndarray:
    """The row turned as little as its own symmetry allows: the same solid with the smallest rotation."""
    own = row[ROTATION : ROTATION + 4].astype(np.float64)
    changed = row.copy()
    entry = family(name)
    if is_round(row, name) and not entry.extents(shape_of(row)[None]).any():
        changed[ROTATION : ROTATION + 4] = (1.0, 0.0, 0.0, 0.0)
        return changed
    if is_round(row, name):
        axis = matrix_of(own)[:, 2]
        if is_prism(row, name) and axis[2] < 0.0:
            axis = -axis
        changed[ROTATION : ROTATION + 4] = (
            turn_between(np.array([0.0, 0.0, 1.0]), axis) if axis[2] > -0.999 else own
        )
        return changed
    turns = [turn for turn in ROTATIONS if _keeps(turn, row, name)]
    best = max(turns, key=lambda turn: round(abs(float(multiply(own, turn)[0])), 6))
    changed[ROTATION : ROTATION + 4] = canonical_sign(tidy(multiply(own, best)))
    if entry.has("size"):
        order = np.abs(matrix_of(best)).round().astype(int)
        size = shape_of(changed)[entry.columns("size")]
        size[:] = order.T @ size
    return changed


def _keeps(turn: np.ndarray, row: np.ndarray, name: str) -> bool:
    """True if a rotation of the cube takes the primitive to itself in family and numbers, sizes permuted."""
    matrix = matrix_of(turn).round()
    if is_box(row, name):
        return True
    sweep, bend = matrix[2, 2], matrix[0, 0]
    if abs(sweep) < 1.0 or (sweep < 0.0 and not is_prism(row, name)):
        return False
    if bend > 0.0:
        return True
    return is_straight(row, name) if bend < 0.0 else turns_quarterly(row, name)
