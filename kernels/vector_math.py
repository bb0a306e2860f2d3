"""Scalar functions that LLVM can turn into vector code: no branches, no calls into the maths library.

`wp.min` and `wp.max` look for NaN and cost half as much again; `wp.atan`, `wp.exp` and `wp.sign` forbid vectorising.
"""

from __future__ import annotations

import warp as wp

HALF_PI = wp.constant(1.5707963267948966)
PI = wp.constant(3.141592653589793)


@wp.func
def smaller(a: float, b: float) -> float:
    """The smaller of two finite numbers."""
    return wp.where(a < b, a, b)


@wp.func
def larger(a: float, b: float) -> float:
    """The larger of two finite numbers."""
    return wp.where(a > b, a, b)


@wp.func
def sign(a: float) -> float:
    """-1 below zero, else 1."""
    return wp.where(a < 0.0, -1.0, 1.0)


@wp.func
def clamp_symmetric(a: float, bound: float) -> float:
    """`a` clamped to [-bound, bound]."""
    return larger(smaller(a, bound), -bound)


@wp.func
def atan_ratio(r2: float) -> float:
    """atan(r) / r as a polynomial in r * r, for |r| <= 1; error 1e-7."""
    p = r2 * -0.00478048135 + 0.0245572375
    p = r2 * p - 0.059904908
    p = r2 * p + 0.0994277551
    p = r2 * p - 0.140294272
    p = r2 * p + 0.199713769
    p = r2 * p - 0.333320937
    return r2 * p + 0.999999911


@wp.func
def atan_ratio_grad(r2: float) -> float:
    """Derivative of `atan_ratio` with respect to r * r."""
    p = r2 * (7.0 * -0.00478048135) + 6.0 * 0.0245572375
    p = r2 * p - 5.0 * 0.059904908
    p = r2 * p + 4.0 * 0.0994277551
    p = r2 * p - 3.0 * 0.140294272
    p = r2 * p + 2.0 * 0.199713769
    return r2 * p - 0.333320937
