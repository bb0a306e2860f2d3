"""The terms of a refinement's loss, one entry each: which points have it, its residual, and whose row it makes.

Everything else follows from the table: the bits of a point's rows, the room for them, and the weights.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import warp as wp

from .soft_occupancy import soft_occupancy

FLAT = wp.constant(6.0)
"""Distance in units of 1 / sharpness beyond which the occupancy has no slope to speak of: 1 % of the steepest."""

BLENDED_BELOW = wp.constant(0.98)
"""Share of the owner in the union below which the second nearest gets a row of it too."""

COVERED = 0.5
"""A point is covered by a primitive whose distance there is below this, in units of 1 / sharpness."""
COVERED_C = wp.constant(COVERED)


@wp.func
def is_own(field: float, runner_up: float, share: float, beta: float) -> float:
    """1 where the union has a slope, else 0."""
    return wp.where(wp.abs(beta * field) < FLAT, 1.0, 0.0)


@wp.func
def is_blended(field: float, runner_up: float, share: float, beta: float) -> float:
    """1 where the second nearest moves that union too, else 0."""
    return wp.where(share < BLENDED_BELOW, is_own(field, runner_up, share, beta), 0.0)


@wp.func
def is_covering(field: float, runner_up: float, share: float, beta: float) -> float:
    """1 where the second nearest covers the point and has a slope there, else 0."""
    return wp.where(wp.abs(beta * runner_up) < FLAT, wp.where(runner_up * beta < COVERED_C, 1.0, 0.0), 0.0)


@wp.func
def union_error(field: float, runner_up: float, target: float, beta: float) -> float:
    """Occupancy of the union minus the target's."""
    return soft_occupancy(field, beta) - soft_occupancy(target, beta)


@wp.func
def covered_twice(field: float, runner_up: float, target: float, beta: float) -> float:
    """Occupancy of a second primitive that covers the point."""
    return wp.where(runner_up * beta < COVERED_C, soft_occupancy(runner_up, beta), 0.0)


class Residual(NamedTuple):
    """A term of the loss, and the row that a point adds to the normal equations for it."""

    name: str
    has_row: Any
    """(field, runner_up, share, beta) -> 1 where a point makes a row, 0 elsewhere, as where the occupancy is flat."""
    error: Any
    """(field, runner_up, target, beta) -> the residual; None where an earlier term has counted it."""
    of_second: bool
    """Whether the row is the second nearest primitive's, not the nearest one's."""
    empties: bool
    """Whether the row wants its primitive alone elsewhere; else it wants the union to be the target."""
    weight: str = ""
    """Field of `RefineConfig` that weighs the term; 1 without one."""


RESIDUALS = (
    Residual("own", is_own, union_error, of_second=False, empties=False),
    Residual("blended", is_blended, None, of_second=True, empties=False),
    Residual("covering", is_covering, covered_twice, of_second=True, empties=True, weight="overlap"),
)
"""Bit n of a point's kind is that of the n-th term; rows are written in this order."""

RESIDUAL_COUNT = len(RESIDUALS)
"""Most rows of a point."""

ResidualWeights = wp.types.vector(length=RESIDUAL_COUNT, dtype=float)


def residual_weights(config: Any) -> tuple[float, ...]:
    """The weight of each term, from a `RefineConfig`."""
    return tuple(
        float(getattr(config, residual.weight)) if residual.weight else 1.0 for residual in RESIDUALS
    )
