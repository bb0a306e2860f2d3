"""A primitive family of your own: a regular hexagonal prism that may taper to a pyramid.

Name this file to the command line, and the family is there like those of the package:

    RESFIT_FAMILIES=examples/hexagonal_prism.py .venv/bin/resfit fit nut.stl --primitive hexagonal_prism

A package that is installed does the same by an entry point: in pyproject.toml, under
[project.entry-points."resfit.families"], `hexagonal_prism = "my_package.hexagonal_prism:FAMILY"`. Scripts call
`resfit.kernels.primitives.register(FAMILY)`. What a family must say is written in kernels/primitives/family.py.
"""

# Warp types kernels, not Python.
# pyright: reportGeneralTypeIssues=false, reportArgumentType=false, reportInvalidTypeForm=false

from __future__ import annotations

import math

import numpy as np
import warp as wp

from resfit.kernels.primitives.canonical_rules import Change, Rule
from resfit.kernels.primitives.family import Box, Family, Symmetries
from resfit.kernels.primitives.parameters import LENGTH_MAX, Parameter, ParameterTable
from resfit.kernels.primitives.swept_solids import SweptSolids, shapes_by_name
from resfit.kernels.rows import SHAPES_C, Derivatives
from resfit.kernels.vector_math import larger, sign

SINE = wp.constant(math.sqrt(0.75))
LENGTH = {"unit": "length", "legal": (0.0, math.inf), "fit": (1e-3, LENGTH_MAX), "slider": (0.0, 2.0)}


@wp.struct
class HexagonalPrism:
    """The table entry: numbers of the row, and the slope of the sides."""

    width: float
    height: float
    taper: float
    middle: float
    """Distance of the sides from the axis at half the height."""
    slope: float
    cosine: float


@wp.func
def derive_hexagonal_prism(rows: wp.array[float], base: int) -> HexagonalPrism:
    """Table entry from a row: width, height, taper."""
    s = HexagonalPrism()
    s.width = rows[base + SHAPES_C]
    s.height = larger(rows[base + SHAPES_C + 1], 1.0e-6)
    s.taper = rows[base + SHAPES_C + 2]
    s.middle = 0.25 * s.width * (1.0 + s.taper)
    s.slope = 0.5 * s.width * (s.taper - 1.0) / s.height
    s.cosine = 1.0 / wp.sqrt(1.0 + s.slope * s.slope)
    return s


@wp.func
def sdf_hexagonal_prism(s: HexagonalPrism, x: float, y: float, z: float) -> float:
    """The farthest of the eight planes: exact inside, a lower bound beside edges."""
    across = larger(wp.abs(x), 0.5 * wp.abs(x) + SINE * wp.abs(y))
    return larger((across - s.middle - s.slope * z) * s.cosine, wp.abs(z) - 0.5 * s.height)


@wp.func
def sdf_hexagonal_prism_grad(s: HexagonalPrism, x: float, y: float, z: float) -> Derivatives:
    """Value and derivatives to the point, width, height and taper."""
    corner = wp.where(0.5 * wp.abs(x) + SINE * wp.abs(y) > wp.abs(x), 1.0, 0.0)
    across = (1.0 - 0.5 * corner) * wp.abs(x) + corner * SINE * wp.abs(y)
    beyond = across - s.middle - s.slope * z
    side, cap = beyond * s.cosine, wp.abs(z) - 0.5 * s.height
    a = wp.where(side >= cap, 1.0, 0.0)
    turning = -beyond * s.slope * s.cosine * s.cosine * s.cosine - s.cosine * z
    by_width = -0.25 * s.cosine * (1.0 + s.taper) + turning * 0.5 * (s.taper - 1.0) / s.height
    by_taper = -0.25 * s.cosine * s.width + turning * 0.5 * s.width / s.height
    out = Derivatives()
    out[0] = larger(side, cap)
    out[1] = a * s.cosine * (1.0 - 0.5 * corner) * sign(x)
    out[2] = a * s.cosine * corner * SINE * sign(y)
    out[3] = (1.0 - a) * sign(z) - a * s.cosine * s.slope
    out[4] = a * by_width
    out[5] = -0.5 * (1.0 - a) - a * turning * s.slope / s.height
    out[6] = a * by_taper
    return out


@wp.func
def reach_hexagonal_prism(s: HexagonalPrism, x: float, y: float, z: float, radius: float) -> float:
    """The field is 1-Lipschitz."""
    return radius


def bounds(shape: np.ndarray) -> Box:
    """Two sides face along x, two corners along y."""
    width, height, taper = (float(number) for number in shape[:3])
    across = 0.5 * width * max(taper, 1.0)
    half = np.maximum([across, 2.0 / math.sqrt(3.0) * across, 0.5 * height], 1e-6)
    return -half, half


def starts(family: ParameterTable, solids: SweptSolids) -> tuple[np.ndarray, np.ndarray]:
    """The prism or pyramid of the solid's height and about its section."""
    width = np.sqrt(solids.extents[:, 0] * solids.extents[:, 1] * math.sqrt(0.75))
    given = {"width": width, "height": solids.extents[:, 2], "roundness": solids.roundness}
    return shapes_by_name(family, solids, given)


def straighten(family: ParameterTable, shape: np.ndarray) -> Change | None:
    """A prism, of the width at half the height, in place of what hardly tapers."""
    taper = float(shape[2])
    if taper == 1.0 or abs(taper - 1.0) > 0.1:
        return None
    values = {"width": float(shape[0]) * 0.5 * (1.0 + taper), "taper": 1.0}
    return Change(1.0, family.with_values(shape, values), abs(taper - 1.0))


FAMILY = Family(
    name="hexagonal_prism",
    description="regular hexagonal prism or truncated pyramid",
    parameters=(
        Parameter("width", "distance of opposite sides at the bottom", default=(0.5,), **LENGTH),
        Parameter("height", "extent along z", default=(0.5,), **LENGTH),
        Parameter("taper", "width at the top by that at the bottom", "ratio", (0, 2), (0, 2), (1.0,), (0, 2)),
    ),
    table=HexagonalPrism,
    derive=derive_hexagonal_prism,
    sdf=sdf_hexagonal_prism,
    sdf_grad=sdf_hexagonal_prism_grad,
    reach=reach_hexagonal_prism,
    bounds=bounds,
    starts=starts,
    symmetries=Symmetries(half_turn_z={}, half_turn_x={"taper": 1.0}),
    rules=(Rule("taper", 0.015, straighten),),
    glsl="""
float sdf_hexagonal_prism(vec3 p, float s[8]) {
  float height = max(s[1], 1e-6), slope = 0.5 * s[0] * (s[2] - 1.0) / height;
  float across = max(abs(p.x), 0.5 * abs(p.x) + sqrt(0.75) * abs(p.y));
  float side = (across - 0.25 * s[0] * (1.0 + s[2]) - slope * p.z) / sqrt(1.0 + slope * slope);
  return max(side, abs(p.z) - 0.5 * height);
}
""",
    javascript="""
{bounds: p => {
  const x = 0.5 * p.width * Math.max(p.taper, 1);
  const half = [x, 2 * x / Math.sqrt(3), 0.5 * p.height].map(value => Math.max(value, 1e-6));
  return [half.map(value => -value), half];
}, stepping: p => ({slack: 0.5})}
""",
)
