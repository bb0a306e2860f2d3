"""SuperFrustum: one signed distance for boxes, cylinders, cones, spheres, tori, bent and hollow forms.

Stages (docs/superfrustum.md): straighten the arc, distance in the profile plane, distance in the (inset, height) half
plane, dilation. The field has no jumps (superfrustum.md, "Behind the arc's centre").

Derivatives (superfrustum.md, "Derivatives") are hand-written and free of branches, in the order of the row's shape:
size (3), roundness, dilation, taper, bulge, onion. At the arc's centre the derivative is unbounded: whoever sums over
points clips per point.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import warp as wp

from ..rows import SHAPES_C, Derivatives
from ..vector_math import HALF_PI, larger, smaller
from .canonical_rules import PRISM, PROFILE, SHARP, SOLID, SQUARE, Change, Rule
from .dilated import flat_ended, without_extent
from .family import Box, Family, PointMap, Symmetries
from .parameters import (
    Parameter,
    ParameterTable,
    dilation_parameter,
    onion_parameter,
    roundness_parameter,
    size_parameter,
)
from .stages.bend import (
    ARCTAN_GLSL,
    Bend,
    behind_centre,
    bend_points,
    bent_box,
    derive_bend,
    straighten,
    straighten_grad,
    straighten_other,
    straighten_other_grad,
)
from .stages.profile import (
    PROFILE_GLSL,
    Profile,
    derive_profile,
    sdf_profile,
    sdf_profile_grad,
    sdf_profile_shape_grad,
)
from .stages.trapezoid import (
    EDGE_GLSL,
    STRAIGHT_GLSL,
    Trapezoid,
    derive_trapezoid,
    sdf_trapezoid,
    sdf_trapezoid_grad,
    wall_thickness,
)


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
def sdf_straight_grad(s: SuperFrustum, x: float, y: float, z: float):
    """The undilated distance at a straightened point and its derivatives.

    Returns:
        g, dg/dx, dg/dy, dg/dz, dg/dsx, dg/dsy, dg/dh, dg/droundness, dg/dtaper, dg/donion.
    """
    u, ux, uy = sdf_profile_grad(s.profile, x, y)
    g, gu, gz, gh, gm, gtaper, gonion = sdf_trapezoid_grad(s.trapezoid, u, z)
    gx, gy, gsx, gsy, ground = sdf_profile_shape_grad(s.profile, x, y, gu, gm, ux, uy)
    return g, gx, gy, gz, gsx, gsy, gh, ground, gtaper, gonion


@wp.func
def sdf_superfrustum_fast_grad(s: SuperFrustum, x: float, y: float, z: float) -> Derivatives:
    """Value and derivatives in front of the arc's centre (see `sdf_superfrustum_fast`)."""
    sx, sz, xx, xz, xh, xt, zx, zz, zh, zt = straighten_grad(s.bend, x, z)
    g, gx, gy, gz, gsx, gsy, gh, ground, gtaper, gonion = sdf_straight_grad(s, sx, y, sz)
    dx = gx * xx + gz * zx
    dz = gx * xz + gz * zz
    dh = gh + gx * xh + gz * zh
    dtheta = gx * xt + gz * zt
    return Derivatives(
        g - s.dilation,
        dx,
        gy,
        dz,
        gsx,
        gsy,
        0.5 * dh,
        ground,
        -1.0,
        gtaper,
        HALF_PI * dtheta,
        gonion,
    )


@wp.func
def sdf_superfrustum_grad(s: SuperFrustum, x: float, y: float, z: float) -> Derivatives:
    """Value and derivatives anywhere: near + weight (other - near) where the other end is nearer."""
    sx, sz, xx, xz, xh, xt, zx, zz, zh, zt = straighten_grad(s.bend, x, z)
    g, gx, gy, gz, gsx, gsy, gh, ground, gtaper, gonion = sdf_straight_grad(s, sx, y, sz)
    ox, oz, weight, wx, wz, wh, wt, oxx, oxz, oxh, oxt, ozx, ozz, ozh, ozt = straighten_other_grad(
        s.bend, x, z
    )
    k, kx, ky, kz, ksx, ksy, kh, kround, ktaper, konion = sdf_straight_grad(s, ox, y, oz)
    nearer = k < g
    gain = wp.where(nearer, k - g, 0.0)
    b = wp.where(nearer, weight, 0.0)
    a = 1.0 - b
    dx = a * (gx * xx + gz * zx) + b * (kx * oxx + kz * ozx) + gain * wx
    dz = a * (gx * xz + gz * zz) + b * (kx * oxz + kz * ozz) + gain * wz
    dh = a * (gh + gx * xh + gz * zh) + b * (kh + kx * oxh + kz * ozh) + gain * wh
    dtheta = a * (gx * xt + gz * zt) + b * (kx * oxt + kz * ozt) + gain * wt
    return Derivatives(
        g + weight * gain - s.dilation,
        dx,
        a * gy + b * ky,
        dz,
        a * gsx + b * ksx,
        a * gsy + b * ksy,
        0.5 * dh,
        a * ground + b * kround,
        -1.0,
        a * gtaper + b * ktaper,
        HALF_PI * dtheta,
        a * gonion + b * konion,
    )


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


GLSL = (
    "\n"
    + PROFILE_GLSL
    + EDGE_GLSL
    + ARCTAN_GLSL
    + STRAIGHT_GLSL
    + """\
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
)

JAVASCRIPT = """
{bounds: p => {
  const size = p.size.map(value => Math.max(value, 1e-6)), theta = 0.5 * Math.PI * p.bulge;
  const grow = Math.max(p.taper - 1, 0) * 0.5 * Math.min(size[0], size[1]);
  const half = [0.5 * size[0] + grow, 0.5 * size[1] + grow, 0.5 * size[2]];
  const low = half.map(value => -value), high = half.slice();
  if (theta !== 0) {
    const bend = Math.abs(theta), x = half[0], h = half[2];
    low[0] = -h * Math.tan(0.5 * bend) - x;
    high[0] = x * Math.max(Math.cos(bend), 0);
    high[2] = h + x * Math.sin(bend);
    low[2] = -high[2];
    if (theta < 0) [low[0], high[0]] = [-high[0], -low[0]];
  }
  return [low.map(value => value - p.dilation), high.map(value => value + p.dilation)];
}, stepping: p => {
  // Distances to the arc's centre tell how steep a bent field is.
  const theta = 0.5 * Math.PI * p.bulge, h = 0.5 * Math.max(p.size[2], 1e-6), bent = Math.abs(theta) > 1e-4;
  return {
    arc: bent ? h / Math.abs(theta) : 0,
    centre: bent ? h / Math.tan(theta) : 0,
    sign: Math.sign(theta),
    slack: 0.7 - 0.2 * Math.min(1, 2 * Math.abs(theta)),
  };
}}
"""

TAPER, BULGE = 5, 6
"""Places in a shape."""
LOOKS_BENT = 1e-3
"""Bulge from which the field is noticeably steeper than a distance."""
BENT_SLOPE = 2.0
"""How much steeper than a distance the field of bent forms is taken to be."""
BENT_STEP = 0.8
"""Share of a bent field's value that is stepped: it is steeper than 1.25 at fewer than one point in 500."""
NEAR_BULGE = 0.06
"""A quarter of a turn is 1: an arc of 5 degrees is nearly straight."""


def superfrustum_bounds(shape: np.ndarray) -> Box:
    """Exact box but for bent forms, where it is a little too large; a taper above 1 widens the top."""
    half = 0.5 * np.maximum(np.asarray(shape[:3], np.float64), 1e-6)
    dilation, theta = float(shape[4]), 0.5 * math.pi * float(shape[BULGE])
    half[:2] += max(float(shape[TAPER]) - 1.0, 0.0) * half[:2].min()
    low, high = bent_box(half, theta)
    return low - dilation, high + dilation


def superfrustum_walls(shape: np.ndarray) -> np.ndarray:
    """Thickness along each axis; across the sweep that of the wall, where it is hollow."""
    taper, bulge, onion = (float(number) for number in shape[TAPER:])
    thin = wall_thickness(shape[:3], float(shape[4]), onion, taper)
    if bulge != 0.0:
        thin[[0, 2]] = thin[[0, 2]].min()
    return thin


def straightened_shape(shape: np.ndarray) -> tuple[np.ndarray, PointMap] | None:
    """The straight form of a bent one, and how it is bent, where the profile stays clear of the arc's centre.

    The field is that of the straight form at the straightened point, so that the surface is the same.
    """
    theta = 0.5 * math.pi * float(shape[BULGE])
    if theta == 0.0:
        return None
    straight = shape.copy()
    straight[BULGE] = 0.0
    half_height = 0.5 * max(float(shape[2]), 1e-6)
    if superfrustum_bounds(straight)[1][0] >= 0.98 * half_height / math.sin(abs(theta)):
        return None
    return straight, partial(bend_points, half_height=half_height, theta=theta)


def _straight(family: ParameterTable, shape: np.ndarray) -> Change | None:
    bulge = float(shape[BULGE])
    if bulge == 0.0 or abs(bulge) > NEAR_BULGE:
        return None
    # The arc's middle lies to one side of the chord; two thirds of that is its mean.
    sag = 0.5 * float(shape[2]) * np.tan(0.25 * np.pi * bulge)
    shift = np.array([-2.0 / 3.0 * sag, 0.0, 0.0])
    return Change(0.0, family.with_values(shape, {"bulge": 0.0}), abs(bulge), shift)


STRAIGHT = Rule("bulge", 0.01, _straight)

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
    sdf_grad=sdf_superfrustum_grad,
    fast_grad=sdf_superfrustum_fast_grad,
    bounds=superfrustum_bounds,
    javascript=JAVASCRIPT,
    slope=lambda shape: BENT_SLOPE if abs(shape[BULGE]) > LOOKS_BENT else 1.0,
    step=lambda shape: BENT_STEP if abs(shape[BULGE]) > LOOKS_BENT else 1.0,
    walls=superfrustum_walls,
    straightened=straightened_shape,
    symmetries=Symmetries(
        half_turn_z={"bulge": 0.0},
        half_turn_x={"taper": 1.0},
        quarter_turn_z={"bulge": 0.0},
        axis_order={"roundness": 0.0, "taper": 1.0, "bulge": 0.0, "onion": -1.0},
        revolution={"roundness": 1.0, "bulge": 0.0},
    ),
    rules=(SOLID, STRAIGHT, PRISM, SHARP, PROFILE, SQUARE),
    without_extent=without_extent,
    flat_ended=flat_ended,
    fast=sdf_superfrustum_fast,
    seam_zone=slow_zone_superfrustum,
)
