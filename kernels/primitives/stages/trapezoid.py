"""The trapezoid: exact distance in the half plane of inset u and height z (superfrustum.md, "Trapezoid and onion").

Corners, counter-clockwise: bottom left ((onion - 1) m, -h), bottom right (0, -h), top right ((taper - 1) m, h), top
left ((onion taper - 1) m, h). With s the coordinate along an edge's outward normal and e the excess beyond the
edge's ends along it, the squared distance to an edge is s^2 + e^2, inside and outside alike: no cross products and
no division in the point loop.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from ...vector_math import clamp_symmetric, larger, smaller
from .profile import SIZE_FLOOR


@wp.struct
class Trapezoid:
    """Edges as unit normals, offsets and half lengths. R is the outer side, L the inner one, B bottom, T top."""

    half_height: float
    inset: float
    taper: float
    onion: float
    right_u: float
    right_z: float
    right_half: float
    left_u: float
    left_z: float
    left_offset: float
    left_middle: float
    left_half: float
    bottom_middle: float
    bottom_half: float
    top_middle: float
    top_half: float
    right_inverse: float
    """1 / (edge length), here and below: turns a coordinate along the edge into the share of its far corner."""
    left_inverse: float
    bottom_inverse: float
    top_inverse: float


@wp.func
def derive_trapezoid(inset: float, size_z: float, taper: float, onion: float) -> Trapezoid:
    """The trapezoid's table entry from the inset radius m, the full height, taper and onion."""
    t = Trapezoid()
    height = wp.max(size_z, SIZE_FLOOR)
    t.half_height = 0.5 * height
    t.inset = inset
    t.taper = taper
    t.onion = onion
    bottom_left = (onion - 1.0) * inset
    top_left = (onion * taper - 1.0) * inset
    top_right = (taper - 1.0) * inset
    lean = onion * (taper - 1.0) * inset
    right = wp.sqrt(top_right * top_right + height * height)
    left = wp.sqrt(lean * lean + height * height)
    t.right_u = height / right
    t.right_z = -top_right / right
    t.right_half = 0.5 * right
    t.left_u = -height / left
    t.left_z = lean / left
    t.left_offset = height * bottom_left / left
    t.left_middle = bottom_left * lean / left + 0.5 * left
    t.left_half = 0.5 * left
    t.bottom_middle = 0.5 * bottom_left
    t.bottom_half = 0.5 * wp.abs(bottom_left)
    t.top_middle = 0.5 * (top_left + top_right)
    t.top_half = 0.5 * wp.abs(top_right - top_left)
    t.right_inverse = 1.0 / right
    t.left_inverse = 1.0 / left
    t.bottom_inverse = 0.5 / wp.max(t.bottom_half, 1.0e-12)
    t.top_inverse = 0.5 / wp.max(t.top_half, 1.0e-12)
    return t


@wp.func
def sdf_trapezoid(t: Trapezoid, u: float, z: float) -> float:
    """Distance of (u, z) to the trapezoid's outline, negative inside."""
    above_bottom = z + t.half_height
    above_top = z - t.half_height
    right = u * t.right_u + above_bottom * t.right_z
    left = u * t.left_u + above_bottom * t.left_z + t.left_offset
    deep = larger(larger(right, left), larger(above_top, -above_bottom))
    along_right = above_bottom * t.right_u - u * t.right_z - t.right_half
    along_left = u * t.left_z - above_bottom * t.left_u - t.left_middle
    excess_right = larger(wp.abs(along_right) - t.right_half, 0.0)
    excess_left = larger(wp.abs(along_left) - t.left_half, 0.0)
    excess_bottom = larger(wp.abs(u - t.bottom_middle) - t.bottom_half, 0.0)
    excess_top = larger(wp.abs(u - t.top_middle) - t.top_half, 0.0)
    sides = smaller(right * right + excess_right * excess_right, left * left + excess_left * excess_left)
    caps = smaller(
        above_bottom * above_bottom + excess_bottom * excess_bottom,
        above_top * above_top + excess_top * excess_top,
    )
    return wp.where(deep < 0.0, deep, wp.sqrt(smaller(sides, caps)))


@wp.func
def sdf_trapezoid_grad(t: Trapezoid, u: float, z: float):
    """The distance g and its derivatives.

    Returns:
        g, dg/du, dg/dz, dg/dh, dg/dm, dg/dtaper, dg/donion. With n the unit gradient, a corner that carries the share
        w of the nearest point moves the distance by -n w: all parameters follow from the four corners.
    """
    above_bottom = z + t.half_height
    above_top = z - t.half_height
    right = u * t.right_u + above_bottom * t.right_z
    left = u * t.left_u + above_bottom * t.left_z + t.left_offset
    deep = larger(larger(right, left), larger(above_top, -above_bottom))

    along_right = above_bottom * t.right_u - u * t.right_z - t.right_half
    along_left = u * t.left_z - above_bottom * t.left_u - t.left_middle
    along_bottom = u - t.bottom_middle
    along_top = u - t.top_middle
    on_right = clamp_symmetric(along_right, t.right_half)
    on_left = clamp_symmetric(along_left, t.left_half)
    on_bottom = clamp_symmetric(along_bottom, t.bottom_half)
    on_top = clamp_symmetric(along_top, t.top_half)
    excess_right = along_right - on_right
    excess_left = along_left - on_left
    excess_bottom = along_bottom - on_bottom
    excess_top = along_top - on_top
    square_right = right * right + excess_right * excess_right
    square_left = left * left + excess_left * excess_left
    square_bottom = above_bottom * above_bottom + excess_bottom * excess_bottom
    square_top = above_top * above_top + excess_top * excess_top
    share_right = on_right * t.right_inverse + 0.5
    share_left = on_left * t.left_inverse + 0.5
    share_bottom = 0.5 - on_bottom * t.bottom_inverse
    share_top = 0.5 - on_top * t.top_inverse

    # The nearest edge's normal coordinate, excess, normal (nu, nz), direction (tu, tz), the shares of its corners and
    # `drop`: how much of a growing half height moves the nearest point down (1 on the bottom) rather than up (-1).
    is_left = square_left < square_right
    square = wp.where(is_left, square_left, square_right)
    normal = wp.where(is_left, left, right)
    excess = wp.where(is_left, excess_left, excess_right)
    nu = wp.where(is_left, t.left_u, t.right_u)
    nz = wp.where(is_left, t.left_z, t.right_z)
    tu = wp.where(is_left, t.left_z, -t.right_z)
    tz = wp.where(is_left, -t.left_u, t.right_u)
    bottom_left = wp.where(is_left, 1.0 - share_left, 0.0)
    top_left = wp.where(is_left, share_left, 0.0)
    top_right = wp.where(is_left, 0.0, share_right)
    drop = 1.0 - 2.0 * wp.where(is_left, share_left, share_right)
    is_bottom = square_bottom < square
    square = wp.where(is_bottom, square_bottom, square)
    normal = wp.where(is_bottom, -above_bottom, normal)
    excess = wp.where(is_bottom, excess_bottom, excess)
    nu = wp.where(is_bottom, 0.0, nu)
    nz = wp.where(is_bottom, -1.0, nz)
    tu = wp.where(is_bottom, 1.0, tu)
    tz = wp.where(is_bottom, 0.0, tz)
    bottom_left = wp.where(is_bottom, share_bottom, bottom_left)
    top_left = wp.where(is_bottom, 0.0, top_left)
    top_right = wp.where(is_bottom, 0.0, top_right)
    drop = wp.where(is_bottom, 1.0, drop)
    is_top = square_top < square
    square = wp.where(is_top, square_top, square)
    normal = wp.where(is_top, above_top, normal)
    excess = wp.where(is_top, excess_top, excess)
    nu = wp.where(is_top, 0.0, nu)
    nz = wp.where(is_top, 1.0, nz)
    tu = wp.where(is_top, 1.0, tu)
    tz = wp.where(is_top, 0.0, tz)
    bottom_left = wp.where(is_top, 0.0, bottom_left)
    top_left = wp.where(is_top, share_top, top_left)
    top_right = wp.where(is_top, 1.0 - share_top, top_right)
    drop = wp.where(is_top, -1.0, drop)

    g = wp.where(deep < 0.0, deep, wp.sqrt(square))
    inverse = 1.0 / wp.where(wp.abs(g) < 1.0e-20, 1.0e-20, g)
    # On an edge's own side the gradient is its normal, inside too; a point behind the edge's line but outside the
    # polygon sees the edge from its back.
    faces = wp.where(normal * deep < 0.0, -1.0, 1.0)
    gu = wp.where(excess == 0.0, faces * nu, (normal * nu + excess * tu) * inverse)
    gz = wp.where(excess == 0.0, faces * nz, (normal * nz + excess * tz) * inverse)
    dm = -gu * (
        bottom_left * (t.onion - 1.0) + top_left * (t.onion * t.taper - 1.0) + top_right * (t.taper - 1.0)
    )
    donion = -gu * t.inset * (bottom_left + top_left * t.taper)
    dtaper = -gu * t.inset * (top_left * t.onion + top_right)
    return g, gu, gz, gz * drop, dm, dtaper, donion


NARROWEST_TOP = 0.5
"""Walls that taper off are followed down to this share of their width at the bottom."""


def wall_thickness(size: np.ndarray, dilation: float, onion: float, taper: float = 1.0) -> np.ndarray:
    """Thickness (3,) of a form along each axis; across the sweep that of its wall, where it is hollow."""
    size = np.maximum(size.astype(np.float64), 1e-6)
    thin = size + 2.0 * dilation
    if onion > 0.0:
        wall = 0.5 * float(size[:2].min()) * (1.0 - onion) * min(max(taper, NARROWEST_TOP), 1.0)
        thin[:2] = np.minimum(thin[:2], wall + 2.0 * dilation)
    return thin


EDGE_GLSL = """\
float sdf_superfrustum_edge(vec2 p, vec2 a, vec2 b) {
  vec2 e = b - a;
  vec2 v = p - a;
  vec2 d = v - e * clamp(dot(v, e) / max(dot(e, e), 1e-18), 0.0, 1.0);
  return dot(d, d);
}
"""
"""Squared distance to an edge, for a page."""


STRAIGHT_GLSL = """\
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
"""
"""The trapezoid over the profile, for a page."""
