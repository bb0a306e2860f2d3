"""The cuboid's value and all derivatives, hand-written and free of branches."""

from __future__ import annotations

import warp as wp

from ..rows import Derivatives
from ..vector_math import larger, sign
from .cuboid import Cuboid


@wp.func
def sdf_cuboid_grad(c: Cuboid, x: float, y: float, z: float) -> Derivatives:
    """Value and derivatives; moving a face outwards by half the size is moving the point inwards."""
    qx = wp.abs(x) - c.x
    qy = wp.abs(y) - c.y
    qz = wp.abs(z) - c.z
    ox = larger(qx, 0.0)
    oy = larger(qy, 0.0)
    oz = larger(qz, 0.0)
    deep = larger(qx, larger(qy, qz))
    outside = wp.sqrt(ox * ox + oy * oy + oz * oz)
    inverse = 1.0 / larger(outside, 1.0e-20)
    inside = deep <= 0.0
    is_x = wp.where(qx >= deep, 1.0, 0.0)
    is_y = wp.where(qy >= deep, 1.0 - is_x, 0.0)
    gx = wp.where(inside, is_x, ox * inverse)
    gy = wp.where(inside, is_y, oy * inverse)
    gz = wp.where(inside, 1.0 - is_x - is_y, oz * inverse)
    f = wp.where(inside, deep, outside)
    return Derivatives(
        f,
        gx * sign(x),
        gy * sign(y),
        gz * sign(z),
        -0.5 * gx,
        -0.5 * gy,
        -0.5 * gz,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    )


GRADIENT = {"sdf_grad": sdf_cuboid_grad}
