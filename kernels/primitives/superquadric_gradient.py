"""The superquadric's value and derivatives, through the logarithm of its gauge.

With A and B the shares of the profile and of the height in the gauge's outer sum (A + B = 1) and `s_x`, `s_y` those of
x and y in the inner one, d ln G / d ln x = A s_x and d ln G / d ln z = B: every exponent cancels.
"""

from __future__ import annotations

import warp as wp

from ..rows import Derivatives
from ..vector_math import sign
from .superquadric import BASE_SMALLEST, EXPONENT_SMALLEST, SIZE_SMALLEST, Superquadric, sdf_superquadric


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


GRADIENT = {"sdf_grad": sdf_superquadric_grad}
