"""The profile: exact 2D distance to a rounded rectangle, with its gradient (superfrustum.md, "Profile")."""

from __future__ import annotations

import warp as wp

from ...vector_math import larger, sign, smaller


@wp.struct
class Profile:
    """Rounded rectangle of extents (sx, sy) and roundness r; m = min(sx, sy) / 2 is the inset radius."""

    core_x: float
    """Half extent along x of the rectangle that the corner circles roll around: sx / 2 - r m."""
    core_y: float
    radius: float
    """Corner radius r m."""
    inset: float
    """m, the distance from the medial axis to the outline."""
    roundness: float
    share_x: float
    """dm/dsx: 1/2 where sx is the smaller, 0 where it is the larger, 1/4 on a tie."""
    share_y: float


SIZE_FLOOR = wp.constant(1.0e-6)
"""Sizes are at least this inside the field: edges of length zero have no direction."""


@wp.func
def derive_profile(size_x: float, size_y: float, roundness: float) -> Profile:
    """The profile's table entry from full extents and the corner radius as a share of the inset radius."""
    sx = wp.max(size_x, SIZE_FLOOR)
    sy = wp.max(size_y, SIZE_FLOOR)
    p = Profile()
    p.inset = 0.5 * wp.min(sx, sy)
    p.roundness = roundness
    p.radius = roundness * p.inset
    p.core_x = 0.5 * sx - p.radius
    p.core_y = 0.5 * sy - p.radius
    p.share_x = wp.where(sx < sy, 0.5, wp.where(sx > sy, 0.0, 0.25))
    p.share_y = 0.5 - p.share_x
    return p


@wp.func
def sdf_profile(p: Profile, x: float, y: float) -> float:
    """Distance u of (x, y) to the outline, negative inside, at least -inset."""
    qx = wp.abs(x) - p.core_x
    qy = wp.abs(y) - p.core_y
    corner = wp.sqrt(larger(qx * qx + qy * qy, 1.0e-24))
    return wp.where(smaller(qx, qy) > 0.0, corner, larger(qx, qy)) - p.radius


@wp.func
def sdf_profile_grad(p: Profile, x: float, y: float):
    """The distance u and du/d|x|, du/d|y|, a unit vector. The size and roundness follow from it in the caller."""
    qx = wp.abs(x) - p.core_x
    qy = wp.abs(y) - p.core_y
    corner = wp.sqrt(larger(qx * qx + qy * qy, 1.0e-24))
    inverse = 1.0 / corner
    rounded = smaller(qx, qy) > 0.0
    u = wp.where(rounded, corner, larger(qx, qy)) - p.radius
    ux = wp.where(rounded, qx * inverse, wp.where(qx > qy, 1.0, 0.0))
    uy = wp.where(rounded, qy * inverse, wp.where(qx > qy, 0.0, 1.0))
    return u, ux, uy


@wp.func
def sdf_profile_shape_grad(p: Profile, x: float, y: float, du: float, dm: float, ux: float, uy: float):
    """Chain df/du = `du` and df/dm = `dm` (m seen directly by the trapezoid) back through the profile.

    Returns:
        df/dx, df/dy, df/dsx, df/dsy, df/droundness.
    """
    dx = du * ux
    dy = du * uy
    dradius = dx + dy - du
    dinset = dm + p.roundness * dradius
    return (
        dx * sign(x),
        dy * sign(y),
        p.share_x * dinset - 0.5 * dx,
        p.share_y * dinset - 0.5 * dy,
        p.inset * dradius,
    )


PROFILE_GLSL = """\
float sdf_superfrustum_profile(vec2 p, vec2 size, float roundness) {
  float radius = 0.5 * roundness * min(size.x, size.y);
  vec2 q = abs(p) - 0.5 * size + radius;
  return (min(q.x, q.y) > 0.0 ? length(q) : max(q.x, q.y)) - radius;
}
"""
"""The same for a page."""
