"""SuperFrustum's value and all derivatives, hand-written and free of branches (superfrustum.md, "Derivatives").

Derivatives come in the order of the row's shape: size (3), roundness, dilation, taper, bulge, onion. At the arc's
centre the derivative is unbounded: whoever sums over points clips per point.
"""

from __future__ import annotations

import warp as wp

from ..rows import Derivatives
from ..vector_math import HALF_PI
from .stages.bend import straighten_grad, straighten_other_grad
from .stages.profile import sdf_profile_grad, sdf_profile_shape_grad
from .stages.trapezoid import sdf_trapezoid_grad
from .superfrustum import SuperFrustum


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


GRADIENT = {"sdf_grad": sdf_superfrustum_grad, "fast_grad": sdf_superfrustum_fast_grad}
