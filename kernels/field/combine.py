"""Combining solids: smooth and hard union and difference of two signed distances, and the existence gate.

All operations are one formula. With the sign s of an operation, 1 for the union and -1 for the difference,

    combine(a, b) = s * m(s * a, b),    m(a, b) = min(a, b) - max(r - |a - b|, 0)^2 / (4 r),

where m is the quadratic smooth minimum of radius r, the hard one at r = 0: the difference of a and b is the union of
what is outside a with b, seen from the other side. It is here for Warp, for NumPy and as GLSL, and nowhere else
(superfrustum.md, "Union and difference").
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..vector_math import larger, smaller

UNION, DIFFERENCE = 1.0, -1.0
"""The signs of the operations."""

FAR = wp.constant(1.0e30)
"""The field of nothing: what a union starts from. Far beyond any blend, so the first primitive comes out untouched."""

LEAST_BLEND = wp.constant(1.0e-12)
"""Divisor in the place of a blend of 0, where it is multiplied by zero."""


@wp.func
def gated(distance: float, gate: float) -> float:
    """The gated distance q f + (1 - q): the primitive as it is at gate 1, nothing at gate 0."""
    return gate * distance + (1.0 - gate)


@wp.func
def quarter_inverse(blend: float) -> float:
    """1 / (4 blend), finite at 0 where it is multiplied by zero."""
    return 0.25 / larger(blend, LEAST_BLEND)


@wp.func
def smooth_minimum(a: float, b: float, blend: float, quarter: float) -> float:
    """The union: quadratic smooth minimum of radius `blend`, with `quarter` = `quarter_inverse(blend)`."""
    near = larger(blend - wp.abs(a - b), 0.0)
    return smaller(a, b) - near * near * quarter


@wp.func
def smooth_minimum_share(a: float, b: float, quarter: float) -> float:
    """Derivative to a of the union, in [0, 1]; that to b is the rest, that to blend -share (1 - share) by the envelope
    theorem."""
    return larger(smaller(0.5 + (b - a) * (2.0 * quarter), 1.0), 0.0)


@wp.func
def combine(a: float, b: float, blend: float, quarter: float, sign: float) -> float:
    """The union or difference of two distances, by its `sign`, with `quarter` = `quarter_inverse(blend)`."""
    return sign * smooth_minimum(sign * a, b, blend, quarter)


@wp.func
def combine_grad(a: float, b: float, quarter: float, sign: float) -> wp.vec3:
    """Derivatives of `combine` to a, b and the blend."""
    share = smooth_minimum_share(sign * a, b, quarter)
    return wp.vec3(share, sign * (1.0 - share), -sign * share * (1.0 - share))


@wp.func
def combine_interval(a: wp.vec2, b: wp.vec2, blend: float, quarter: float, sign: float) -> wp.vec2:
    """Bounds (low, high) of `combine` where a and b are in theirs: it rises with a, and with b as its sign says."""
    first = wp.where(sign > 0.0, b[0], b[1])
    second = wp.where(sign > 0.0, b[1], b[0])
    return wp.vec2(
        combine(a[0], first, blend, quarter, sign),
        combine(a[1], second, blend, quarter, sign),
    )


@wp.func
def smooth_minimum_double(a: wp.float64, b: wp.float64, blend: wp.float64) -> wp.float64:
    """The union in double precision, for sums that must not depend on rounding."""
    union = wp.min(a, b)
    near = blend - wp.abs(a - b)
    if near > wp.float64(0.0):
        union -= near * near * (wp.float64(0.25) / blend)
    return union


def combined(a: np.ndarray, b: np.ndarray, blend: float, sign: float = UNION) -> np.ndarray:
    """The NumPy twin of `combine`: distances (n,) of two solids to those of their union or difference."""
    a = a if sign == UNION else sign * a
    lower = np.minimum(a, b)
    if blend > 0:
        near = np.maximum(blend - np.abs(a - b), 0)
        lower = lower - near * near * (0.25 / blend)
    return lower if sign == UNION else sign * lower


def combined_share(a: np.ndarray, b: np.ndarray, blend: float, sign: float = UNION) -> np.ndarray:
    """Derivative (n,) of `combined` to a; that to b is sign * (1 - share), to the blend -sign * share * (1 - share)."""
    a = a if sign == UNION else sign * a
    return np.clip(0.5 + (b - a) * (0.5 / max(blend, float(LEAST_BLEND))), 0.0, 1.0)


def fold(values: Sequence[np.ndarray] | np.ndarray, blends: Sequence[float] | np.ndarray) -> np.ndarray:
    """Smooth union (n,) of distances (primitive_count, n), folded left; the first blend is unused."""
    union = values[0]
    for value, blend in zip(values[1:], blends[1:], strict=True):
        union = combined(union, value, blend)
    return union


GLSL = """
float combine(float a, float b, float blend, float operation) {
  float near = max(blend - abs(operation * a - b), 0.0);
  return operation * (min(operation * a, b) - near * near * 0.25 / max(blend, 1e-12));
}
float combine_share(float a, float b, float blend, float operation) {
  return clamp(0.5 + (b - operation * a) * 0.5 / max(blend, 1e-12), 0.0, 1.0);
}
"""
"""GLSL ES 3.00 text of `combine`, and of its derivative to a."""
