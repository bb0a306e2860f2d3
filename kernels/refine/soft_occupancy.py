"""Occupancy as the losses see it: the logistic function of the field, without a call that forbids vectorising."""

from __future__ import annotations

import warp as wp

from ..vector_math import smaller


@wp.func
def exp_negative(x: float) -> float:
    """exp(-x) for x >= 0, within 5e-7 absolute: a fifth-degree series of exp(-x / 32), squared five times."""
    y = smaller(x, 40.0) * (-1.0 / 32.0)
    p = 1.0 + y * (1.0 + y * (0.5 + y * (1.0 / 6.0 + y * (1.0 / 24.0 + y * (1.0 / 120.0)))))
    p = p * p
    p = p * p
    p = p * p
    p = p * p
    return p * p


@wp.func
def soft_occupancy(distance: float, beta: float) -> float:
    """sigmoid(-beta distance): 1 deep inside, 1/2 on the surface, 0 far outside."""
    e = exp_negative(beta * wp.abs(distance))
    share = 1.0 / (1.0 + e)
    return wp.where(distance > 0.0, e * share, share)
