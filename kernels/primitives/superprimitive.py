"""Superprimitive: the SuperFrustum without taper and bulge, always an exact distance outside."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..rows import SHAPES_C, Derivatives
from .canonical_rules import PROFILE, SHARP, SOLID, SQUARE
from .dilated import flat_ended, without_extent
from .family import Box, Family, Symmetries
from .parameters import dilation_parameter, onion_parameter, roundness_parameter, size_parameter
from .stages.profile import Profile, derive_profile, sdf_profile, sdf_profile_grad, sdf_profile_shape_grad
from .stages.trapezoid import Trapezoid, derive_trapezoid, sdf_trapezoid, sdf_trapezoid_grad, wall_thickness


@wp.struct
class Superprimitive:
    """The table entry: profile, its upright trapezoid, and the offset."""

    profile: Profile
    trapezoid: Trapezoid
    dilation: float


@wp.func
def derive_superprimitive(rows: wp.array[float], base: int) -> Superprimitive:
    """Table entry from a row: size (3), roundness, dilation, onion."""
    s = Superprimitive()
    shape = base + SHAPES_C
    s.profile = derive_profile(rows[shape], rows[shape + 1], rows[shape + 3])
    s.trapezoid = derive_trapezoid(s.profile.inset, rows[shape + 2], 1.0, rows[shape + 5])
    s.dilation = rows[shape + 4]
    return s


@wp.func
def sdf_superprimitive(s: Superprimitive, x: float, y: float, z: float) -> float:
    """Signed distance at a local point, negative inside."""
    return sdf_trapezoid(s.trapezoid, sdf_profile(s.profile, x, y), z) - s.dilation


@wp.func
def sdf_superprimitive_grad(s: Superprimitive, x: float, y: float, z: float) -> Derivatives:
    """Value and derivatives."""
    u, ux, uy = sdf_profile_grad(s.profile, x, y)
    g, gu, gz, gh, gm, _gtaper, gonion = sdf_trapezoid_grad(s.trapezoid, u, z)
    gx, gy, gsx, gsy, ground = sdf_profile_shape_grad(s.profile, x, y, gu, gm, ux, uy)
    return Derivatives(g - s.dilation, gx, gy, gz, gsx, gsy, 0.5 * gh, ground, -1.0, gonion, 0.0, 0.0)


@wp.func
def reach_superprimitive(s: Superprimitive, x: float, y: float, z: float, radius: float) -> float:
    """The field is 1-Lipschitz."""
    return radius


def superprimitive_bounds(shape: np.ndarray) -> Box:
    """The sizes, and the dilation around them."""
    half = 0.5 * np.maximum(np.asarray(shape[:3], np.float64), 1e-6) + float(shape[4])
    return -half, half


def superprimitive_walls(shape: np.ndarray) -> np.ndarray:
    """Thickness along each axis; across the sweep that of the wall, where it is hollow."""
    return wall_thickness(shape[:3], float(shape[4]), float(shape[5]))


FAMILY = Family(
    name="superprimitive",
    description="rounded profile swept straight, hollowed and dilated",
    parameters=(
        size_parameter("full extents before dilation; z is the sweep axis"),
        roundness_parameter(),
        dilation_parameter(),
        onion_parameter(),
    ),
    table=Superprimitive,
    derive=derive_superprimitive,
    sdf=sdf_superprimitive,
    sdf_grad=sdf_superprimitive_grad,
    reach=reach_superprimitive,
    bounds=superprimitive_bounds,
    walls=superprimitive_walls,
    symmetries=Symmetries(
        half_turn_z={},
        half_turn_x={},
        quarter_turn_z={},
        axis_order={"roundness": 0.0, "onion": -1.0},
        revolution={"roundness": 1.0},
    ),
    rules=(SOLID, SHARP, PROFILE, SQUARE),
    without_extent=without_extent,
    flat_ended=flat_ended,
    glsl="""
float sdf_superprimitive(vec3 p, float s[8]) {
  vec3 size = max(vec3(s[0], s[1], s[2]), vec3(1e-6));
  float m = 0.5 * min(size.x, size.y);
  float radius = s[3] * m;
  vec2 q = abs(p.xy) - 0.5 * size.xy + radius;
  float u = (min(q.x, q.y) > 0.0 ? length(q) : max(q.x, q.y)) - radius;
  float z = abs(p.z) - 0.5 * size.z;
  float w = max(u, (s[5] - 1.0) * m - u);
  return length(max(vec2(w, z), vec2(0.0))) + min(max(w, z), 0.0) - s[4];
}
""",
    javascript="""
{bounds: p => {
  const half = p.size.map(value => 0.5 * Math.max(value, 1e-6) + p.dilation);
  return [half.map(value => -value), half];
}}
""",
)
