"""The standard form of each primitive: parameters that are canonical but for rounding made exactly so.

A ball, a capsule and a ring are SuperFrusta without extent that dilation makes thick: fitting ends a little beside
them, where sizes are nearly 0 and taper and bulge mean nothing. Lengths are normalised.
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
    parameter_of,
    with_parameter,
)
from .constraints import Constraints, Copied, tidy, turn_between
from .rigid_motion import canonical_sign
from .snap_axes import ROTATIONS

THIN = 0.08
"""A size below this share of the dilation may be none."""

SLENDER = 10.0
"""A capsule longer than this many radii may be a rod with flat ends, which are too small to have been told apart."""

NEARLY_ONE = 0.99
"""Onion above which a wall is none, where dilation makes it thick."""

NEAR = {"bulge": 0.01, "taper": 0.015, "roundness": 0.03, "dilation": 2e-3, "square": 0.01, "onion": 0.0}
"""How far from a canonical value a parameter may be to be tried."""

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
    shape = SHAPES + np.array([0, 1, 2, entry.columns("dilation").start])
    # Of a ring both sides of the profile are one diameter.
    lengths = [shape[:2], shape[2:3], shape[3:]] if row[SHAPES] == row[SHAPES + 1] else list(shape[:, None])
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
    dilation = parameter_of(row, name, "dilation", 0.0)
    if dilation <= 0.0:
        return row
    changed = row.copy()
    sizes = row[SHAPES : SHAPES + 3].astype(np.float64)
    thin = sizes < THIN * dilation
    onion = parameter_of(row, name, "onion", -1.0)
    if onion > NEARLY_ONE and not thin[:2].any():
        # A ring: half the wall's thickness goes inwards, half outwards.
        wall = 0.5 * min(sizes[0], sizes[1]) * (1.0 - onion)
        grown = 0.25 * (wall + sizes[2]) if thin[2] else 0.5 * wall
        changed[SHAPES : SHAPES + 2] = sizes[:2] - wall
        changed[SHAPES + 2] = 0.0 if thin[2] else sizes[2] - wall
        changed = with_parameter(changed, name, "onion", 1.0)
        return with_parameter(changed, name, "dilation", dilation + grown)
    if thin.sum() < 2:
        return row
    # A ball or a capsule: what is left is at most one length, which becomes the sweep.
    grown = 0.5 * float(sizes[thin].mean())
    length = 0.0 if thin.all() else float(sizes.max()) - 2.0 * grown
    if not thin.all():
        axis = int(np.argmax(sizes))
        turn = np.eye(3)[:, [(axis + 1) % 3, (axis + 2) % 3, axis]]
        own = row[ROTATION : ROTATION + 4].astype(np.float64)
        changed[ROTATION : ROTATION + 4] = multiply(own, quaternion_of(turn))
    values = {"size": (0.0, 0.0, max(length, 0.0)), "dilation": dilation + grown, "roundness": 1.0}
    shape = family(name).shape_row(**values)
    changed[SHAPES : SHAPES + len(shape)] = shape
    return changed


def _flat_ended(row: np.ndarray, name: str) -> np.ndarray:
    """The cylinder that is as long and as thick as a capsule: a thin rod ends as one or the other."""
    dilation = parameter_of(row, name, "dilation", 0.0)
    width, depth, length = row[SHAPES : SHAPES + 3].tolist()
    if dilation <= 0.0 or width > 0.0 or depth > 0.0 or length < SLENDER * dilation:
        return row
    changed = row.copy()
    shape = family(name).shape_row(
        size=(2.0 * dilation, 2.0 * dilation, length + 2.0 * dilation), roundness=1.0
    )
    changed[SHAPES : SHAPES + len(shape)] = shape
    return changed


def _canonical(row: np.ndarray, name: str) -> np.ndarray:
    """A row with every parameter canonical that is so but for rounding."""
    tried: set[tuple[str, float]] = set()
    while True:
        fresh = [
            (parameter, value, changed)
            for parameter, value, changed in canonical_changes(row, name)
            if (parameter, value) not in tried and _distance(row, name, parameter, value) <= NEAR[parameter]
        ]
        if not fresh:
            return row
        parameter, value, row = fresh[0]
        tried.add((parameter, value))


def _distance(row: np.ndarray, name: str, parameter: str, value: float) -> float:
    """How far a parameter is from a canonical value, as `NEAR` counts it."""
    found = parameter_of(row, name, parameter, value)
    if parameter == "square":
        x, y = (float(size) for size in row[SHAPES : SHAPES + 2])
        return abs(x - y) / max(x, y)
    if parameter == "onion":
        return max(0.0, found)
    if parameter == "taper":
        # What dilation makes thick tapers less than its profile does.
        width = float(row[SHAPES : SHAPES + 2].max())
        return abs(found - value) * width / (width + 2.0 * parameter_of(row, name, "dilation", 0.0))
    return abs(found - value)


def _plainest_pose(row: np.ndarray, name: str) -> np.ndarray:
    """The row turned as little as its own symmetry allows: the same solid with the smallest rotation."""
    own = row[ROTATION : ROTATION + 4].astype(np.float64)
    changed = row.copy()
    if not row[SHAPES : SHAPES + 3].any() and is_round(row, name):
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
    order = np.abs(matrix_of(best)).round().astype(int)
    changed[SHAPES : SHAPES + 3] = order.T @ row[SHAPES : SHAPES + 3]
    return changed


def _keeps(turn: np.ndarray, row: np.ndarray, name: str) -> bool:
    """Whether a rotation of the cube takes the primitive to one of its family with the same numbers, sizes permuted."""
    matrix = matrix_of(turn).round()
    if is_box(row, name):
        return True
    sweep, bend = matrix[2, 2], matrix[0, 0]
    if abs(sweep) < 1.0 or (sweep < 0.0 and not is_prism(row, name)):
        return False
    # Along the bend nothing but the mirror plane is free.
    return is_straight(row, name) or bend > 0.0
