"""Superquadric (Barr 1981), with its radial approximation of the distance: |p| (1 - 1 / G(p)).

G is the degree-one gauge of the solid, 1 on its surface. The result is exact along rays through the centre and in
sign; elsewhere it overestimates the distance of flat or pointed shapes.
"""

from __future__ import annotations

import warp as wp

from ..rows import SHAPES_C
from .family import Family, Parameter, size_parameter


@wp.struct
class Superquadric:
    """The table entry: full extents and the two exponents."""

    size_x: float
    size_y: float
    size_z: float
    exponent_z: float
    exponent_xy: float


SIZE_SMALLEST = wp.constant(1.0e-4)
"""Extents are at least this: the gauge divides by them."""
EXPONENT_SMALLEST = wp.constant(0.05)
"""Below this the powers 2 / e leave float32; the shape is a box to 2 % already."""
BASE_SMALLEST = wp.constant(1.0e-6)
"""Bases of powers are at least this: the derivative to the exponent has a logarithm of the base."""


@wp.func
def derive_superquadric(rows: wp.array[float], base: int) -> Superquadric:
    """Table entry from a row: size (3), exponents (2)."""
    s = Superquadric()
    shape = base + SHAPES_C
    s.size_x = rows[shape]
    s.size_y = rows[shape + 1]
    s.size_z = rows[shape + 2]
    s.exponent_z = rows[shape + 3]
    s.exponent_xy = rows[shape + 4]
    return s


@wp.func
def sdf_superquadric(s: Superquadric, x: float, y: float, z: float) -> float:
    """Approximate signed distance at a local point, negative inside."""
    ax = wp.abs(x) / (0.5 * wp.max(s.size_x, SIZE_SMALLEST))
    ay = wp.abs(y) / (0.5 * wp.max(s.size_y, SIZE_SMALLEST))
    az = wp.abs(z) / (0.5 * wp.max(s.size_z, SIZE_SMALLEST))
    e1 = wp.max(s.exponent_z, EXPONENT_SMALLEST)
    e2 = wp.max(s.exponent_xy, EXPONENT_SMALLEST)
    # The gauge is taken at the point scaled to its largest share, so that no power overflows.
    scale = wp.max(ax, wp.max(ay, az))
    if scale < 1.0e-5:
        return -0.5 * wp.max(wp.min(s.size_x, wp.min(s.size_y, s.size_z)), SIZE_SMALLEST)
    ux = wp.max(ax / scale, BASE_SMALLEST)
    uy = wp.max(ay / scale, BASE_SMALLEST)
    uz = wp.max(az / scale, BASE_SMALLEST)
    wide = wp.max(ux, uy)
    across = wp.pow(ux / wide, 2.0 / e2) + wp.pow(uy / wide, 2.0 / e2)
    gauge = scale * wp.pow(wp.pow(wide, 2.0 / e1) * wp.pow(across, e2 / e1) + wp.pow(uz, 2.0 / e1), 0.5 * e1)
    return wp.sqrt(x * x + y * y + z * z) * (1.0 - 1.0 / gauge)


@wp.func
def reach_superquadric(s: Superquadric, x: float, y: float, z: float, radius: float) -> float:
    """|grad| <= 1 + R^2 / (r |p|) with R the outer and r the inner radius; unbounded at the centre."""
    biggest = wp.max(wp.max(s.size_x, wp.max(s.size_y, s.size_z)), SIZE_SMALLEST)
    smallest = wp.max(wp.min(s.size_x, wp.min(s.size_y, s.size_z)), SIZE_SMALLEST)
    nearest = wp.sqrt(x * x + y * y + z * z) - radius
    steepest = 1.0 + 2.6 * biggest * biggest / (smallest * wp.max(nearest, 1.0e-6))
    return wp.where(nearest > 0.0, radius * steepest, 1.0e6)


FAMILY = Family(
    name="superquadric",
    description="superellipsoid; its distance is approximate",
    parameters=(
        size_parameter("full extents"),
        Parameter(
            "exponents",
            "shape along z and across it: 0 a box, 1 an ellipsoid, 2 an octahedron",
            "ratio",
            (0.0, 2.0),
            (0.1, 1.9),
            (1.0, 1.0),
            (0.0, 2.0),
        ),
    ),
    table=Superquadric,
    derive=derive_superquadric,
    sdf=sdf_superquadric,
    reach=reach_superquadric,
    approximate=True,
    glsl="""
float sdf_superquadric(vec3 p, float s[8]) {
  vec3 q = abs(p) / (0.5 * max(vec3(s[0], s[1], s[2]), vec3(1e-4)));
  float e1 = max(s[3], 0.05), e2 = max(s[4], 0.05);
  float scale = max(q.x, max(q.y, q.z));
  if (scale < 1e-5) return -0.5 * max(min(s[0], min(s[1], s[2])), 1e-4);
  vec3 u = max(q / scale, vec3(1e-6));
  float wide = max(u.x, u.y);
  float across = pow(u.x / wide, 2.0 / e2) + pow(u.y / wide, 2.0 / e2);
  float gauge = scale * pow(pow(wide, 2.0 / e1) * pow(across, e2 / e1) + pow(u.z, 2.0 / e1), 0.5 * e1);
  return length(p) * (1.0 - 1.0 / gauge);
}
""",
)
