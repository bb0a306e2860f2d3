"""Joining primitives: smooth and hard union of two distances, and the existence gate (spec section 12)."""

from __future__ import annotations

import warp as wp

from .vector_math import larger, smaller

FAR = wp.constant(1.0e30)
"""The field of nothing: what a union starts from. Far beyond any blend, so the first primitive comes out untouched."""


@wp.func
def gated(distance: float, gate: float) -> float:
    """The gated distance q f + (1 - q): the primitive as it is at gate 1, nothing at gate 0."""
    return gate * distance + (1.0 - gate)


@wp.func
def smooth_minimum(a: float, b: float, blend: float, quarter: float) -> float:
    """Quadratic smooth minimum of radius `blend`, with `quarter` = `quarter_inverse(blend)`."""
    near = larger(blend - wp.abs(a - b), 0.0)
    return smaller(a, b) - near * near * quarter


@wp.func
def quarter_inverse(blend: float) -> float:
    """1 / (4 blend), finite at 0 where it is multiplied by zero."""
    return 0.25 / larger(blend, 1.0e-12)


@wp.func
def smooth_minimum_share(a: float, b: float, quarter: float) -> float:
    """dU/da, in [0, 1]; dU/db is the rest and dU/dblend = -share (1 - share), by the envelope theorem."""
    return larger(smaller(0.5 + (b - a) * (2.0 * quarter), 1.0), 0.0)
