"""Cuboid: the exact distance to a box."""

from __future__ import annotations

import warp as wp

from ..rows import SHAPES_C
from ..vector_math import larger
from .family import Family, size_parameter


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
def reach_cuboid(c: Cuboid, x: float, y: float, z: float, radius: float) -> float:
    """The field is 1-Lipschitz."""
    return radius


FAMILY = Family(
    name="cuboid",
    description="box with sharp edges",
    parameters=(size_parameter("full extents"),),
    table=Cuboid,
    derive=derive_cuboid,
    sdf=sdf_cuboid,
    reach=reach_cuboid,
    glsl="""
float sdf_cuboid(vec3 p, float s[8]) {
  vec3 q = abs(p) - 0.5 * vec3(s[0], s[1], s[2]);
  return length(max(q, vec3(0.0))) + min(max(q.x, max(q.y, q.z)), 0.0);
}
""",
)
