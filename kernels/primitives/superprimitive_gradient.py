"""The superprimitive's value and all derivatives, from the stages it shares with the SuperFrustum."""

from __future__ import annotations

import warp as wp

from ..rows import Derivatives
from .stages.profile import sdf_profile_grad, sdf_profile_shape_grad
from .stages.trapezoid import sdf_trapezoid_grad
from .superprimitive import Superprimitive


@wp.func
def sdf_superprimitive_grad(s: Superprimitive, x: float, y: float, z: float) -> Derivatives:
    """Value and derivatives."""
    u, ux, uy = sdf_profile_grad(s.profile, x, y)
    g, gu, gz, gh, gm, _gtaper, gonion = sdf_trapezoid_grad(s.trapezoid, u, z)
    gx, gy, gsx, gsy, ground = sdf_profile_shape_grad(s.profile, x, y, gu, gm, ux, uy)
    return Derivatives(g - s.dilation, gx, gy, gz, gsx, gsy, 0.5 * gh, ground, -1.0, gonion, 0.0, 0.0)


GRADIENT = {"sdf_grad": sdf_superprimitive_grad}
