"""One primitive's damped normal equations solved by one thread, in float64: elimination without pivoting.

The damping keeps every pivot positive. Rows are worked on whole, so that they become vector code, although only the
upper triangle means anything. Other loops have bounds that are known at run time only: Warp would unroll constant ones.
"""

from __future__ import annotations

import warp as wp

from ..rows import BLEND_C, SHAPE, SHAPES_C, TANGENT
from ..runtime.launch import VECTOR_OPTIONS

UNKNOWNS = TANGENT + 1
"""A Jacobian row's columns, then the blend radius."""
SYSTEM = UNKNOWNS + 1
"""Columns of a system: those of the unknowns, then the residual."""
RESIDUAL = UNKNOWNS
"""Column of the residual."""
SYSTEM_C, RESIDUAL_C, UNKNOWNS_C = wp.constant(SYSTEM), wp.constant(RESIDUAL), wp.constant(UNKNOWNS)
FIRST_SHAPE, BLEND_UNKNOWN = wp.constant(TANGENT - SHAPE), wp.constant(TANGENT)

System = wp.types.matrix(shape=(UNKNOWNS, SYSTEM), dtype=wp.float64)
SystemRow = wp.types.vector(length=SYSTEM, dtype=wp.float64)

SOLVER_OPTIONS = VECTOR_OPTIONS | {"max_unroll": 8}
"""Module options of kernels that solve: loops over a row stay loops, which LLVM turns into vector code."""


@wp.func
def solve_symmetric(a: System, count: int) -> SystemRow:
    """x with A x = b for the leading `count` unknowns, 0 for the others; b is the last column.

    Only the upper triangle of the positive A is read.
    """
    x = SystemRow()
    pivot = SystemRow()
    inverse = SystemRow()
    for j in range(count):
        inverse[j] = wp.float64(1.0) / a[j, j]
        # A copy: a compiler cannot know that two rows of one matrix do not overlap.
        for m in range(SYSTEM_C):
            pivot[m] = a[j, m]
        for i in range(j + 1, count):
            factor = pivot[i] * inverse[j]
            for m in range(SYSTEM_C):
                a[i, m] -= factor * pivot[m]
    for back in range(count):
        j = count - 1 - back
        left = a[j, RESIDUAL_C]
        for m in range(j + 1, count):
            left -= a[j, m] * x[m]
        x[j] = left * inverse[j]
    return x


@wp.func
def damped_step(
    systems: wp.array[float],
    rows: wp.array[float],
    low: wp.array[float],
    high: wp.array[float],
    most_blend: float,
    damping: float,
    system: int,
    row: int,
    bound: int,
    count: int,
) -> SystemRow:
    """The increment (count = UNKNOWNS of them) that lowers one system's residual, not yet limited in length.

    Args:
        systems: SYSTEM x SYSTEM from index `system` on, of which the upper triangle is read.
        rows: of the primitive from index `row` on: shapes on a bound do not move further out.
        low, high: ranges of its shapes from index `bound` on; equal ones hold the shape.
        most_blend: largest blend radius; 0 holds all of them.
        damping: relative to the system's diagonal.
    """
    a = System()
    free = SystemRow()
    one = wp.float64(1.0)
    for i in range(count):
        slope = systems[system + i * SYSTEM_C + RESIDUAL_C]
        free[i] = one
        if i == BLEND_UNKNOWN:
            # A plain joint, of blend 0, stays one: nothing pulls at it.
            value = rows[row + BLEND_C]
            if most_blend <= 0.0 or value <= 0.0 or (value >= most_blend and slope < 0.0):
                free[i] = wp.float64(0.0)
        elif i >= FIRST_SHAPE:
            shape = i - FIRST_SHAPE
            value = rows[row + SHAPES_C + shape]
            least = low[bound + shape]
            most = high[bound + shape]
            if most <= least or (value <= least and slope > 0.0) or (value >= most and slope < 0.0):
                free[i] = wp.float64(0.0)
    free[RESIDUAL_C] = -one
    mean = wp.float64(0.0)
    for i in range(count):
        for m in range(SYSTEM_C):
            a[i, m] = wp.float64(systems[system + i * SYSTEM_C + m]) * free[i] * free[m]
        mean += a[i, i]
    # Directions that the points do not see stay finite; those that are held get a pivot of the system's own size.
    scale = mean / wp.float64(UNKNOWNS_C) + wp.float64(1.0e-12)
    damp = wp.float64(damping)
    least_pivot = (wp.float64(1.0e-4) * damp + wp.float64(1.0e-7)) * scale
    for i in range(count):
        a[i, i] = a[i, i] * (one + damp) + least_pivot + (one - free[i]) * scale
    return solve_symmetric(a, count)
