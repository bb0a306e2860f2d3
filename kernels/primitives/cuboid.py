"""Cuboid: the exact distance to a box."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..rows import SHAPES_C, Derivatives
from ..vector_math import larger, sign
from .canonical_rules import SQUARE
from .family import Box, Family, Symmetries
from .parameters import size_parameter


@wp.struct
class Cuboid:
    """The table entry: half extents."""

    x: float
    y: float
    z: float


@wp.func
def derive_cuboid(rows: wp.array[float], base: int) -> Cuboid:
    """Table entry from a row: size (3)."""
    c = Cuboid()
    c.x = 0.5 * rows[base + SHAPES_C]
    c.y = 0.5 * rows[base + SHAPES_C + 1]
    c.z = 0.5 * rows[base + SHAPES_C + 2]
    return c


@wp.func
def sdf_cuboid(c: Cuboid, x: float, y: float, z: float) -> float:
    """Signed distance at a local point, negative inside."""
    qx = wp.abs(x) - c.x
    qy = wp.abs(y) - c.y
    qz = wp.abs(z) - c.z
    ox = larger(qx, 0.0)
    oy = larger(qy, 0.0)
    oz = larger(qz, 0.0)
    deep = larger(qx, larger(qy, qz))
    return wp.where(deep < 0.0, deep, wp.sqrt(ox * ox + oy * oy + oz * oz))


@wp.func
def sdf_cuboid_grad(c: Cuboid, x: float, y: float, z: float) -> Derivatives:
    """Value and derivatives, free of branches; moving a face outwards by half the size is moving the point inwards."""
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


@wp.func
def reach_cuboid(c: Cuboid, x: float, y: float, z: float, radius: float) -> float:
    """The field is 1-Lipschitz."""
    return radius


def cuboid_bounds(shape: np.ndarray) -> Box:
    """The box itself."""
    half = 0.5 * np.maximum(np.asarray(shape[:3], np.float64), 1e-6)
    return -half, half


FAMILY = Family(
    name="cuboid",
    description="box with sharp edges",
    parameters=(size_parameter("full extents"),),
    table=Cuboid,
    derive=derive_cuboid,
    sdf=sdf_cuboid,
    sdf_grad=sdf_cuboid_grad,
    reach=reach_cuboid,
    bounds=cuboid_bounds,
    symmetries=Symmetries(half_turn_z={}, half_turn_x={}, quarter_turn_z={}, axis_order={}),
    rules=(SQUARE,),
    glsl="""
float sdf_cuboid(vec3 p, float s[8]) {
  vec3 q = abs(p) - 0.5 * vec3(s[0], s[1], s[2]);
  return length(max(q, vec3(0.0))) + min(max(q.x, max(q.y, q.z)), 0.0);
}
""",
    javascript="""
{bounds: p => {
  const half = p.size.map(value => 0.5 * Math.max(value, 1e-6));
  return [half.map(value => -value), half];
}}
""",
)
