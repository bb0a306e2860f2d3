"""The bend: straightening the arc that a primitive's axis follows (superfrustum.md, "Straightening the arc").

The form used is regular at bulge 0 and signed; both halves |z| share one case. Behind the arc's centre the plain bend
jumps: there the straight extension of the other end counts too, faded in over the seam zone.
"""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ...vector_math import HALF_PI, PI, atan_ratio, atan_ratio_grad, larger, sign, smaller


@wp.struct
class Bend:
    """Half height h and half angle theta of the arc, with all that is transcendental in them."""

    half_height: float
    inverse_height: float
    sine: float
    cosine: float
    curvature: float
    """sin(theta) / h, the signed inverse radius."""
    sagitta: float
    """h sin(theta)."""
    arc: float
    """h / |theta|: height per radian."""
    angle: float
    """|theta|."""
    inverse_angle: float
    turn: float
    """The sign of theta, 1 at zero."""
    sinc: float
    sinc_slope: float
    """d log sinc / d theta."""


@wp.func
def derive_bend(half_height: float, bulge: float) -> Bend:
    """The bend's table entry: half angle theta = bulge pi / 2 of either sign, chord 2 h."""
    b = Bend()
    theta = bulge * HALF_PI
    square = theta * theta
    b.half_height = half_height
    b.inverse_height = 1.0 / half_height
    b.sine = wp.sin(theta)
    b.cosine = wp.cos(theta)
    b.curvature = b.sine / half_height
    b.sagitta = b.sine * half_height
    b.angle = wp.abs(theta)
    b.inverse_angle = 1.0 / wp.max(b.angle, 1.0e-12)
    b.arc = half_height * b.inverse_angle
    b.turn = wp.where(theta < 0.0, -1.0, 1.0)
    if b.angle < 0.05:
        b.sinc = 1.0 - square * (1.0 / 6.0) * (1.0 - square * 0.05)
    else:
        b.sinc = b.sine / theta
    # cot(theta) - 1 / theta cancels for small angles: its series, good to 1e-7 below 0.7.
    if b.angle < 0.7:
        b.sinc_slope = -theta * (
            1.0 / 3.0
            + square
            * (1.0 / 45.0 + square * (2.0 / 945.0 + square * (1.0 / 4725.0 + square * (2.0 / 93555.0))))
        )
    else:
        b.sinc_slope = b.cosine / b.sine - 1.0 / theta
    return b


@wp.func
def arc_angle(across: float, along: float) -> float:
    """atan2(across, along) for across >= 0, exact enough away from along > across (there the caller has its own)."""
    size = wp.abs(along)
    # Written as in `straighten`, so that the compiler computes it once for both.
    inverse = 1.0 / larger(larger(across, size), 1.0e-20)
    r = smaller(across, size) * inverse
    ratio = atan_ratio(r * r)
    angle = r * ratio
    return wp.where(across > size, HALF_PI - wp.where(along < 0.0, -angle, angle), PI - angle)


@wp.func
def behind_centre(b: Bend, x: float) -> float:
    """Above 0 where the point lies behind the arc's centre, the only half space that the seam zone can touch."""
    return b.curvature * x - b.cosine


@wp.func
def straighten(b: Bend, x: float, z: float):
    """The straightened point (x', z'); x' comes out mirrored, which the even profile does not see."""
    height = wp.abs(z)
    across = wp.abs(b.curvature) * height
    along = b.cosine - b.curvature * x
    size = wp.abs(along)
    radius = wp.sqrt(across * across + along * along)
    inverse = 1.0 / larger(larger(across, size), 1.0e-20)
    r = smaller(across, size) * inverse
    ratio = atan_ratio(r * r)
    angle = r * ratio
    phi = wp.where(across > size, HALF_PI - wp.where(along < 0.0, -angle, angle), PI - angle)
    z_arc = wp.where(along >= across, height * b.sinc * inverse * ratio, b.arc * phi)
    x_arc = (b.curvature * (x * x + z * z) - b.sagitta - 2.0 * x * b.cosine) / (radius + 1.0)
    over = height - b.half_height
    x_end = over * b.sine - x * b.cosine
    z_end = b.half_height + x * b.sine + over * b.cosine
    beyond = z_arc > b.half_height
    straight_z = wp.where(beyond, z_end, z_arc)
    return wp.where(beyond, x_end, x_arc), wp.where(z < 0.0, -straight_z, straight_z)


@wp.func
def straighten_other(b: Bend, x: float, z: float):
    """The point in the other end's straight extension, and the weight in [0, 1] of that end.

    Returns:
        x', z', weight.
    """
    height = wp.abs(z)
    across = wp.abs(b.curvature) * height
    along = b.cosine - b.curvature * x
    over = height + b.half_height
    x_other = -over * b.sine - x * b.cosine
    z_other = -b.half_height - x * b.sine + over * b.cosine
    weight = 1.0 - (PI - arc_angle(across, along)) * b.inverse_angle
    weight = wp.where(along < 0.0, larger(weight, 0.0), 0.0)
    return x_other, wp.where(z < 0.0, -z_other, z_other), weight


@wp.func
def straighten_grad(b: Bend, x: float, z: float):
    """The straightened point and its Jacobian.

    Returns:
        x', z', then the derivatives of x' to x, z, h, theta and those of z' to x, z, h, theta.
    """
    side = sign(z)
    height = wp.abs(z)
    across = wp.abs(b.curvature) * height
    along = b.cosine - b.curvature * x
    size = wp.abs(along)
    radius = wp.sqrt(across * across + along * along)
    inverse = 1.0 / larger(larger(across, size), 1.0e-20)
    r = smaller(across, size) * inverse
    ratio = atan_ratio(r * r)
    angle = r * ratio
    regular = along >= across
    phi = wp.where(across > size, HALF_PI - wp.where(along < 0.0, -angle, angle), PI - angle)
    z_arc = wp.where(regular, height * b.sinc * inverse * ratio, b.arc * phi)
    inverse_plus = 1.0 / (radius + 1.0)
    x_arc = (b.curvature * (x * x + z * z) - b.sagitta - 2.0 * x * b.cosine) * inverse_plus
    over = height - b.half_height
    x_end = over * b.sine - x * b.cosine
    z_end = b.half_height + x * b.sine + over * b.cosine
    beyond = z_arc > b.half_height

    # Inside the sector: x' grows along the radius, z' along the arc.
    inverse_radius = 1.0 / larger(radius, 1.0e-12)
    outward = along * inverse_radius
    upward = across * inverse_radius * b.turn
    stretch = b.sinc * inverse_radius
    xx = -outward
    xz = upward
    zx = stretch * upward
    zz = stretch * outward
    # Both coordinates are homogeneous of degree one in (x, z, h), which gives the height's derivative.
    xh = (x_arc - x * xx - height * xz) * b.inverse_height
    zh = (z_arc - x * zx - height * zz) * b.inverse_height
    xi = x * b.inverse_height
    zeta = height * b.inverse_height
    d_across = b.cosine * zeta * b.turn
    d_along = -b.sine - b.cosine * xi
    d_top = b.cosine * (xi * xi + zeta * zeta - 1.0) + 2.0 * xi * b.sine
    d_radius = (across * d_across + along * d_along) * inverse_radius
    xt = (b.half_height * d_top - x_arc * d_radius) * inverse_plus
    turned = along * d_across - across * d_along
    zt_regular = z_arc * b.sinc_slope + height * b.sinc * inverse * (
        2.0 * r * atan_ratio_grad(r * r) * turned * inverse * inverse - ratio * d_along * inverse
    )
    zt_arc = b.arc * (turned * inverse_radius * inverse_radius - phi * b.inverse_angle * b.turn)
    zt = wp.where(regular, zt_regular, zt_arc)

    xx = wp.where(beyond, -b.cosine, xx)
    xz = wp.where(beyond, b.sine, xz)
    zx = wp.where(beyond, b.sine, zx)
    zz = wp.where(beyond, b.cosine, zz)
    xh = wp.where(beyond, -b.sine, xh)
    zh = wp.where(beyond, 1.0 - b.cosine, zh)
    xt = wp.where(beyond, over * b.cosine + x * b.sine, xt)
    zt = wp.where(beyond, x * b.cosine - over * b.sine, zt)
    straight_z = wp.where(beyond, z_end, z_arc)
    # z was mirrored on the way in: x' is even in z, z' odd.
    return (
        wp.where(beyond, x_end, x_arc),
        side * straight_z,
        xx,
        side * xz,
        xh,
        xt,
        side * zx,
        zz,
        side * zh,
        side * zt,
    )


@wp.func
def straighten_other_grad(b: Bend, x: float, z: float):
    """`straighten_other` and its Jacobian.

    Returns:
        x', z', weight, the derivatives of the weight to x, z, h, theta, then those of x' and z' likewise.
    """
    side = sign(z)
    height = wp.abs(z)
    across = wp.abs(b.curvature) * height
    along = b.cosine - b.curvature * x
    square = larger(across * across + along * along, 1.0e-12)
    phi = arc_angle(across, along)
    weight = 1.0 - (PI - phi) * b.inverse_angle
    inside = wp.where(along < 0.0, wp.where(weight > 0.0, b.inverse_angle / square, 0.0), 0.0)
    # dphi = (along d(across) - across d(along)) / radius^2
    steep = wp.abs(b.curvature)
    wx = inside * across * b.curvature
    wz = side * inside * along * steep
    zeta = height * b.inverse_height
    xi = x * b.inverse_height
    wh = -inside * (along * steep * zeta + across * b.curvature * xi)
    turned = along * b.cosine * zeta * b.turn + across * (b.sine + b.cosine * xi)
    spread = wp.where(inside > 0.0, (PI - phi) * b.inverse_angle * b.inverse_angle * b.turn, 0.0)
    wt = inside * turned + spread
    over = height + b.half_height
    x_other = -over * b.sine - x * b.cosine
    z_other = -b.half_height - x * b.sine + over * b.cosine
    return (
        x_other,
        side * z_other,
        wp.where(inside > 0.0, weight, 0.0),
        wx,
        wz,
        wh,
        wt,
        -b.cosine,
        -side * b.sine,
        -b.sine,
        x * b.sine - over * b.cosine,
        -side * b.sine,
        b.cosine,
        side * (b.cosine - 1.0),
        side * (-x * b.cosine - over * b.sine),
    )


def bent_box(half: np.ndarray, theta: float) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner (3,) of a box of half extents (3,) that is bent, a little too large."""
    low, high = -half, half.copy()
    if theta != 0.0:
        # The axis is an arc through (0, +-h) with its apex at x = -h tan(theta / 2); the profile stands across it.
        bend, x, h = abs(theta), half[0], half[2]
        low[0] = -h * math.tan(0.5 * bend) - x
        high[0] = x * max(math.cos(bend), 0.0)
        high[2] = h + x * math.sin(bend)
        low[2] = -high[2]
        if theta < 0.0:
            low[0], high[0] = -high[0], -low[0]
    return low, high


def bend_points(points: np.ndarray, half_height: float, theta: float) -> np.ndarray:
    """Bend straight points (n, 3): the inverse of `straighten`.

    The axis from (0, -h) to (0, h) becomes an arc of half angle `theta`, its apex towards -x for theta above 0; what
    lies beyond its ends goes straight on.
    """
    x, y, z = np.asarray(points, np.float64).T
    # `straighten` mirrors x, which the even profile does not see; here it would turn the faces inside out.
    radius = half_height / math.sin(theta)
    centre = radius * math.cos(theta)
    angle = theta * np.clip(z / half_height, -1.0, 1.0)
    beyond = z - np.clip(z, -half_height, half_height)
    bent_x = centre - (radius - x) * np.cos(angle) + beyond * np.sin(angle)
    bent_z = (radius - x) * np.sin(angle) + beyond * np.cos(angle)
    return np.stack([bent_x, y, bent_z], axis=1)


ARCTAN_GLSL = """\
float sdf_superfrustum_arctan(float r2) {
  return 0.999999911 + r2 * (-0.333320937 + r2 * (0.199713769 + r2 * (-0.140294272 + r2 * (0.0994277551 +
    r2 * (-0.059904908 + r2 * (0.0245572375 - r2 * 0.00478048135))))));
}
"""
"""The polynomial of the arctangent, for a page."""
