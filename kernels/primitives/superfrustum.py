"""SuperFrustum: one signed distance for boxes, cylinders, cones, spheres, tori, bent and hollow forms.

Stages (docs/superfrustum.md): straighten the arc, distance in the profile plane, distance in the (inset, height) half
plane, dilation. The field has no jumps (superfrustum.md, "Behind the arc's centre").
"""

from __future__ import annotations

import warp as wp

from ..rows import SHAPES_C
from ..vector_math import larger, smaller
from .family import (
    Family,
    Parameter,
    dilation_parameter,
    onion_parameter,
    roundness_parameter,
    size_parameter,
)
from .stages.bend import Bend, behind_centre, derive_bend, straighten, straighten_other
from .stages.profile import Profile, derive_profile, sdf_profile
from .stages.trapezoid import Trapezoid, derive_trapezoid, sdf_trapezoid


@wp.struct
class SuperFrustum:
    """The table entry: three stages and the offset."""

    bend: Bend
    profile: Profile
    trapezoid: Trapezoid
    dilation: float


@wp.func
def derive_superfrustum(rows: wp.array[float], base: int) -> SuperFrustum:
    """Table entry from a row: size (3), roundness, dilation, taper, bulge, onion."""
    s = SuperFrustum()
    shape = base + SHAPES_C
    s.profile = derive_profile(rows[shape], rows[shape + 1], rows[shape + 3])
    s.trapezoid = derive_trapezoid(s.profile.inset, rows[shape + 2], rows[shape + 5], rows[shape + 7])
    s.bend = derive_bend(s.trapezoid.half_height, rows[shape + 6])
    s.dilation = rows[shape + 4]
    return s


@wp.func
def sdf_straight(s: SuperFrustum, x: float, y: float, z: float) -> float:
    """The undilated distance at a straightened point."""
    return sdf_trapezoid(s.trapezoid, sdf_profile(s.profile, x, y), z)


@wp.func
def sdf_superfrustum_fast(s: SuperFrustum, x: float, y: float, z: float) -> float:
    """The field in front of the arc's centre, where the other end cannot show."""
    sx, sz = straighten(s.bend, x, z)
    return sdf_straight(s, sx, y, sz) - s.dilation


@wp.func
def sdf_superfrustum(s: SuperFrustum, x: float, y: float, z: float) -> float:
    """Signed distance at a local point, negative inside."""
    sx, sz = straighten(s.bend, x, z)
    ox, oz, weight = straighten_other(s.bend, x, z)
    near = sdf_straight(s, sx, y, sz)
    other = sdf_straight(s, ox, y, oz)
    return near + weight * smaller(other - near, 0.0) - s.dilation


@wp.func
def slow_zone_superfrustum(s: SuperFrustum, x: float, y: float, z: float) -> float:
    """Above 0 behind the arc's centre."""
    return behind_centre(s.bend, x)


@wp.func
def reach_superfrustum(s: SuperFrustum, x: float, y: float, z: float, radius: float) -> float:
    """Bound on the field's change within `radius` of a local point.

    Straight: the field is 1-Lipschitz. Bent: |grad| <= max(1, h / (theta r)) at distance r from the arc's centre
    (superfrustum.md, "Lipschitz constant and reach"); the seam adds at most twice that behind it. Unbounded where the
    ball holds the centre.
    """
    along = s.bend.cosine - s.bend.curvature * x
    across = s.bend.curvature * z
    to_centre = wp.sqrt(along * along + across * across) / larger(wp.abs(s.bend.curvature), 1.0e-12)
    nearest = to_centre - radius
    stretch = s.bend.arc / larger(nearest, 1.0e-6)
    steepest = larger(stretch, 1.0) + wp.where(
        behind_centre(s.bend, x) + wp.abs(s.bend.curvature) * radius > 0.0, 2.0 + 2.0 * stretch, 0.0
    )
    change = radius * steepest
    return wp.where(s.bend.angle < 1.0e-6, radius, wp.where(nearest > 0.0, change, 1.0e6))


GLSL = """
float sdf_superfrustum_profile(vec2 p, vec2 size, float roundness) {
  float radius = 0.5 * roundness * min(size.x, size.y);
  vec2 q = abs(p) - 0.5 * size + radius;
  return (min(q.x, q.y) > 0.0 ? length(q) : max(q.x, q.y)) - radius;
}
float sdf_superfrustum_edge(vec2 p, vec2 a, vec2 b) {
  vec2 e = b - a;
  vec2 v = p - a;
  vec2 d = v - e * clamp(dot(v, e) / max(dot(e, e), 1e-18), 0.0, 1.0);
  return dot(d, d);
}
float sdf_superfrustum_arctan(float r2) {
  return 0.999999911 + r2 * (-0.333320937 + r2 * (0.199713769 + r2 * (-0.140294272 + r2 * (0.0994277551 +
    r2 * (-0.059904908 + r2 * (0.0245572375 - r2 * 0.00478048135))))));
}
float sdf_superfrustum_straight(vec3 p, vec3 size, float roundness, float taper, float onion) {
  float h = 0.5 * size.z;
  float m = 0.5 * min(size.x, size.y);
  vec2 q = vec2(sdf_superfrustum_profile(p.xy, size.xy, roundness), p.z);
  vec2 bottom_left = vec2((onion - 1.0) * m, -h);
  vec2 bottom_right = vec2(0.0, -h);
  vec2 top_right = vec2((taper - 1.0) * m, h);
  vec2 top_left = vec2((onion * taper - 1.0) * m, h);
  vec2 right = top_right - bottom_right;
  vec2 left = top_left - bottom_left;
  float side = dot(q - bottom_right, vec2(right.y, -right.x)) / length(right);
  float core = dot(q - bottom_left, vec2(-left.y, left.x)) / length(left);
  float deep = max(max(side, core), abs(q.y) - h);
  if (deep < 0.0) return deep;
  float nearest = min(
    min(sdf_superfrustum_edge(q, bottom_right, top_right), sdf_superfrustum_edge(q, bottom_left, top_left)),
    min(sdf_superfrustum_edge(q, bottom_left, bottom_right), sdf_superfrustum_edge(q, top_left, top_right)));
  return sqrt(nearest);
}
float sdf_superfrustum(vec3 p, float s[8]) {
  vec3 size = max(vec3(s[0], s[1], s[2]), vec3(1e-6));
  float roundness = s[3], taper = s[5], onion = s[7];
  float h = 0.5 * size.z;
  float theta = 1.5707963267948966 * s[6];
  // Series, since WebGL lets sin, cos and atan be off by 1e-3: |theta| is at most a quarter turn.
  float square = theta * theta;
  float sinc = 1.0 + square * (-1.0 / 6.0 + square * (1.0 / 120.0 + square * (-1.0 / 5040.0 +
    square * (1.0 / 362880.0 - square / 39916800.0))));
  float cosine = 1.0 + square * (-0.5 + square * (1.0 / 24.0 + square * (-1.0 / 720.0 +
    square * (1.0 / 40320.0 + square * (-1.0 / 3628800.0 + square / 479001600.0)))));
  float sine = theta * sinc;
  float height = abs(p.z);
  float facing = p.z < 0.0 ? -1.0 : 1.0;
  float across = abs(sine) * height / h;
  float along = cosine - sine * p.x / h;
  float breadth = abs(along);
  float longest = max(max(across, breadth), 1e-20);
  float ratio = min(across, breadth) / longest;
  float arctan = sdf_superfrustum_arctan(ratio * ratio);
  float angle = ratio * arctan;
  float phi = across > breadth ? 1.5707963267948966 - (along < 0.0 ? -angle : angle)
                               : 3.141592653589793 - angle;
  float z = along >= across ? height * sinc * arctan / longest : h * phi / max(abs(theta), 1e-12);
  float x = (sine * (p.x * p.x + p.z * p.z) / h - sine * h - 2.0 * p.x * cosine) /
            (sqrt(across * across + along * along) + 1.0);
  if (z > h) {
    x = (height - h) * sine - p.x * cosine;
    z = h + p.x * sine + (height - h) * cosine;
  }
  float d = sdf_superfrustum_straight(vec3(x, p.y, facing * z), size, roundness, taper, onion);
  float weight = along < 0.0 ? 1.0 - (3.141592653589793 - phi) / max(abs(theta), 1e-12) : 0.0;
  if (weight > 0.0) {
    x = -(height + h) * sine - p.x * cosine;
    z = -h - p.x * sine + (height + h) * cosine;
    float other = sdf_superfrustum_straight(vec3(x, p.y, facing * z), size, roundness, taper, onion);
    d += weight * min(other - d, 0.0);
  }
  return d - s[4];
}
"""

FAMILY = Family(
    name="superfrustum",
    description="rounded profile swept along a straight or bent axis, tapered, hollowed and dilated",
    parameters=(
        size_parameter("full extents before dilation; z is the sweep axis (the chord, where it is bent)"),
        roundness_parameter(),
        dilation_parameter(),
        Parameter(
            "taper",
            "inset of the profile at the top relative to the bottom; 1 is a prism, 0 a point or ridge",
            "ratio",
            (0.0, 2.0),
            (0.0, 2.0),
            (1.0,),
            (0.0, 2.0),
        ),
        Parameter(
            "bulge",
            "half opening angle of the bent axis in quarter turns, towards -x; 1 is half a circle",
            "ratio",
            (-1.0, 1.0),
            (-1.0, 1.0),
            (0.0,),
            (-1.0, 1.0),
        ),
        onion_parameter(),
    ),
    table=SuperFrustum,
    derive=derive_superfrustum,
    sdf=sdf_superfrustum,
    reach=reach_superfrustum,
    glsl=GLSL,
    fast=sdf_superfrustum_fast,
    seam_zone=slow_zone_superfrustum,
)
