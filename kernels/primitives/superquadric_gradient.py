"""The superquadric's derivatives: Warp's generated adjoint, which costs several times a hand-written one."""

from __future__ import annotations

import warp as wp

from ..rows import Derivatives
from .superquadric import Superquadric, sdf_superquadric, superquadric_distance


@wp.func
def sdf_superquadric_grad(s: Superquadric, x: float, y: float, z: float) -> Derivatives:
    """Value and derivatives."""
    gx, gy, gz, sx, sy, sz, e1, e2 = wp.grad(superquadric_distance)(
        x, y, z, s.size_x, s.size_y, s.size_z, s.exponent_z, s.exponent_xy
    )
    return Derivatives(sdf_superquadric(s, x, y, z), gx, gy, gz, sx, sy, sz, e1, e2, 0.0, 0.0, 0.0)


GRADIENT = {"sdf_grad": sdf_superquadric_grad}
