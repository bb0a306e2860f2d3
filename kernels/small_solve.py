"""One primitive's damped normal equations solved by one thread, in float64: LDL^T without pivoting.

The damping keeps every pivot positive. Loops have bounds that are known at run time only: Warp would unroll constant
ones into thousands of lines.
"""

from __future__ import annotations

import warp as wp

from .rows import BLEND_C, SHAPE, SHAPES_C, TANGENT

UNKNOWNS = TANGENT + 1
"""A Jacobian row's columns, then the blend radius."""
SYSTEM = UNKNOWNS + 1
"""Columns of a system: those of the unknowns, then the residual."""
RESIDUAL = UNKNOWNS
"""Column of the residual."""
SYSTEM_C, RESIDUAL_C, UNKNOWNS_C = wp.constant(SYSTEM), wp.constant(RESIDUAL), wp.constant(UNKNOWNS)
FIRST_SHAPE, BLEND_UNKNOWN = wp.constant(TANGENT - SHAPE), wp.constant(TANGENT)

Matrix = wp.types.matrix(shape=(UNKNOWNS, UNKNOWNS), dtype=wp.float64)
Unknowns = wp.types.vector(length=UNKNOWNS, dtype=wp.float64)


@wp.func
def solve_symmetric(a: Matrix, b: Unknowns, count: int) -> Unknowns:
    """x with A x = b for the leading `count` unknowns; only the lower triangle of the positive A is read."""
    pivot = Unknowns()
    x = Unknowns()
    for j in range(count):
        d = a[j, j]
        for m in range(j):
            d -= a[j, m] * a[j, m] * pivot[m]
        pivot[j] = d
        inverse = wp.float64(1.0) / d
        y = b[j]
        for m in range(j):
            y -= a[j, m] * x[m]
        x[j] = y
        for i in range(j + 1, count):
            v = a[i, j]
            for m in range(j):
                v -= a[i, m] * a[j, m] * pivot[m]
            a[i, j] = v * inverse
    for back in range(count):
        j = count - 1 - back
        y = x[j] / pivot[j]
        for m in range(j + 1, count):
            y -= a[m, j] * x[m]
        x[j] = y
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
) -> Unknowns:
    """The increment (count = UNKNOWNS of them) that lowers one system's residual, not yet limited in length.

    Args:
        systems: SYSTEM x SYSTEM from index `system` on, of which the upper triangle is read.
        rows: of the primitive from index `row` on: shapes on a bound do not move further out.
        low, high: ranges of its shapes from index `bound` on; equal ones hold the shape.
        most_blend: largest blend radius; 0 holds all of them.
        damping: relative to the system's diagonal.
    """
    a = Matrix()
    b = Unknowns()
    held = Unknowns()
    one = wp.float64(1.0)
    mean = wp.float64(0.0)
    for i in range(count):
        slope = systems[system + i * SYSTEM_C + RESIDUAL_C]
        if i == BLEND_UNKNOWN:
            # A plain joint, of blend 0, stays one: nothing pulls at it.
            value = rows[row + BLEND_C]
            if most_blend <= 0.0 or value <= 0.0 or (value >= most_blend and slope < 0.0):
                held[i] = one
        elif i >= FIRST_SHAPE:
            shape = i - FIRST_SHAPE
            value = rows[row + SHAPES_C + shape]
            least = low[bound + shape]
            most = high[bound + shape]
            if most <= least or (value <= least and slope > 0.0) or (value >= most and slope < 0.0):
                held[i] = one
        b[i] = -wp.float64(slope) * (one - held[i])
        for j in range(i + 1):
            a[i, j] = wp.float64(systems[system + j * SYSTEM_C + i]) * (one - held[i]) * (one - held[j])
        mean += a[i, i]
    # Directions that the points do not see stay finite; those that are held get a pivot of the system's own size.
    scale = mean / wp.float64(UNKNOWNS_C) + wp.float64(1.0e-12)
    damp = wp.float64(damping)
    least_pivot = (wp.float64(1.0e-4) * damp + wp.float64(1.0e-7)) * scale
    for i in range(count):
        a[i, i] = a[i, i] * (one + damp) + least_pivot + held[i] * scale
    return solve_symmetric(a, b, count)
