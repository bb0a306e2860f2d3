"""Superquadric (Barr 1981), with its radial approximation of the distance: |p| (1 - 1 / G(p)).

G is the degree-one gauge of the solid, 1 on its surface. The result is exact along rays through the centre and in
sign; elsewhere it overestimates the distance of flat or pointed shapes.

Derivatives go through the logarithm of the gauge. With A and B the shares of the profile and of the height in its outer
sum (A + B = 1) and `s_x`, `s_y` those of x and y in the inner one, d ln G / d ln x = A s_x and d ln G / d ln z = B:
every exponent cancels.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from ..rows import SHAPES_C, Derivatives
from ..vector_math import sign
from .canonical_rules import SQUARE
from .family import Box, Family, Symmetries
from .parameters import Parameter, ParameterTable, size_parameter
from .swept_solids import SweptSolids, shapes_by_name


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
def sdf_superquadric_grad(s: Superquadric, x: float, y: float, z: float) -> Derivatives:
    """Value and derivatives; zero derivatives in a speck around the centre, where the direction is lost."""
    hx = 0.5 * wp.max(s.size_x, SIZE_SMALLEST)
    hy = 0.5 * wp.max(s.size_y, SIZE_SMALLEST)
    hz = 0.5 * wp.max(s.size_z, SIZE_SMALLEST)
    e1 = wp.max(s.exponent_z, EXPONENT_SMALLEST)
    e2 = wp.max(s.exponent_xy, EXPONENT_SMALLEST)
    scale = wp.max(wp.abs(x) / hx, wp.max(wp.abs(y) / hy, wp.abs(z) / hz))
    out = Derivatives()
    out[0] = sdf_superquadric(s, x, y, z)
    if scale >= 1.0e-5:
        ux = wp.max(wp.abs(x) / (hx * scale), BASE_SMALLEST)
        uy = wp.max(wp.abs(y) / (hy * scale), BASE_SMALLEST)
        uz = wp.max(wp.abs(z) / (hz * scale), BASE_SMALLEST)
        wide = wp.max(ux, uy)
        px = wp.pow(ux / wide, 2.0 / e2)
        py = wp.pow(uy / wide, 2.0 / e2)
        across = px + py
        profile = wp.pow(wide, 2.0 / e1) * wp.pow(across, e2 / e1)
        height = wp.pow(uz, 2.0 / e1)
        outer = profile + height
        a = profile / outer
        b = height / outer
        radius = wp.sqrt(x * x + y * y + z * z)
        shrink = 1.0 / (scale * wp.pow(outer, 0.5 * e1))
        slope = radius * shrink
        along = (1.0 - shrink) / radius
        gx = a * px / across
        gy = a * py / across
        out[1] = along * x + slope * gx / (ux * scale * hx) * sign(x)
        out[2] = along * y + slope * gy / (uy * scale * hy) * sign(y)
        out[3] = along * z + slope * b / (uz * scale * hz) * sign(z)
        out[4] = -0.5 * slope * gx / hx
        out[5] = -0.5 * slope * gy / hy
        out[6] = -0.5 * slope * b / hz
        log_across = wp.log(across) + 2.0 / e2 * wp.log(wide)
        out[7] = slope * (0.5 * wp.log(outer) - 0.5 * a * e2 / e1 * log_across - b / e1 * wp.log(uz))
        inner = (px * wp.log(ux) + py * wp.log(uy)) / across
        out[8] = slope * 0.5 * a * (log_across - 2.0 / e2 * inner)
    return out


@wp.func
def reach_superquadric(s: Superquadric, x: float, y: float, z: float, radius: float) -> float:
    """|grad| <= 1 + R^2 / (r |p|) with R the outer and r the inner radius; unbounded at the centre."""
    biggest = wp.max(wp.max(s.size_x, wp.max(s.size_y, s.size_z)), SIZE_SMALLEST)
    smallest = wp.max(wp.min(s.size_x, wp.min(s.size_y, s.size_z)), SIZE_SMALLEST)
    nearest = wp.sqrt(x * x + y * y + z * z) - radius
    steepest = 1.0 + 2.6 * biggest * biggest / (smallest * wp.max(nearest, 1.0e-6))
    return wp.where(nearest > 0.0, radius * steepest, 1.0e6)


def superquadric_bounds(shape: np.ndarray) -> Box:
    """The sizes."""
    half = 0.5 * np.maximum(np.asarray(shape[:3], np.float64), 1e-6)
    return -half, half


FLATNESS_FACTOR = 4.0
"""Step length, times the smallest size by the largest. Over a plate of half thickness t, at z above its middle and R
from its axis, the radial approximation is R (1 - t / z): a step of less than 5.8 t / R of it ends before the plate or
inside, never behind it."""


def superquadric_step(shape: np.ndarray) -> float:
    """Share of the field's value that ends before or inside a plate."""
    size = np.maximum(shape[:3], 1e-4)
    return min(1.0, FLATNESS_FACTOR * float(size.min() / size.max()))


def superquadric_starts(family: ParameterTable, solids: SweptSolids) -> tuple[np.ndarray, np.ndarray]:
    """Exponents make boxes, cylinders and ellipsoids of one size."""
    ends = np.where(solids.dilation > 0.0, 1.0, 0.2)
    exponents = np.stack([ends, 0.2 + 0.8 * solids.roundness], axis=1)
    given = {"exponents": exponents, "dilation": solids.dilation, "roundness": solids.roundness}
    return shapes_by_name(family, solids, given)


MESH_RINGS = (24, 48)
"""Rings of the mesh, and points of a ring."""


def superquadric_mesh(shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (v, 3) and faces (f, 3) from the two angles: the surface is known, where the field is only near."""
    size, exponents = np.maximum(shape[:3].astype(np.float64), 1e-6), shape[3:5].astype(np.float64)
    rings, around = MESH_RINGS

    def power(values: np.ndarray, exponent: float) -> np.ndarray:
        return np.sign(values) * np.abs(values) ** max(exponent, 0.05)

    latitude = np.linspace(-0.5 * np.pi, 0.5 * np.pi, rings + 1)[1:-1, None]
    longitude = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)[None]
    across = power(np.cos(latitude), exponents[0])
    x = across * power(np.cos(longitude), exponents[1])
    y = across * power(np.sin(longitude), exponents[1])
    z = np.broadcast_to(power(np.sin(latitude), exponents[0]), x.shape)
    poles = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    vertices = np.concatenate([np.stack([x, y, z], axis=2).reshape(-1, 3), poles]) * (0.5 * size)
    ring, point = np.meshgrid(np.arange(rings - 2), np.arange(around), indexing="ij")
    a, b = ring * around + point, ring * around + (point + 1) % around
    sides = np.stack([a, b, b + around, a, b + around, a + around], axis=2).reshape(-1, 3)
    here = np.arange(around)
    there, top, count = (here + 1) % around, (rings - 2) * around, (rings - 1) * around
    bottoms = np.stack([np.full(around, count), there, here], axis=1)
    tops = np.stack([np.full(around, count + 1), top + here, top + there], axis=1)
    return vertices, np.concatenate([sides, bottoms, tops])


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
            (0.3, 1.7),
        ),
    ),
    table=Superquadric,
    derive=derive_superquadric,
    sdf=sdf_superquadric,
    sdf_grad=sdf_superquadric_grad,
    reach=reach_superquadric,
    bounds=superquadric_bounds,
    step=superquadric_step,
    mesh=superquadric_mesh,
    starts=superquadric_starts,
    symmetries=Symmetries(
        half_turn_z={}, half_turn_x={}, quarter_turn_z={}, revolution={"exponents": (None, 1.0)}
    ),
    rules=(SQUARE,),
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
    javascript="""
{bounds: p => {
  const half = p.size.map(value => 0.5 * Math.max(value, 1e-6));
  return [half.map(value => -value), half];
}, stepping: p => {
  const size = p.size.map(value => Math.max(value, 1e-4));
  return {factor: Math.min(1, Math.max(0.08, 4 * Math.min(...size) / Math.max(...size)))};
}}
""",
)
