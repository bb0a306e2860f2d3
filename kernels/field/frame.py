"""Poses: world to local for points, local to world for gradients, and the chains to quaternion and axis-angle."""

from __future__ import annotations

import warp as wp

from ..rows import ROTATION_C, TRANSLATION_C


@wp.struct
class Frame:
    """World to local: local = R^T (p - c), as nine entries of R^T and -R^T c, scalars so that loops vectorise."""

    xx: float
    xy: float
    xz: float
    yx: float
    yy: float
    yz: float
    zx: float
    zy: float
    zz: float
    x: float
    y: float
    z: float


@wp.func
def derive_frame(rows: wp.array[float], base: int) -> Frame:
    """The frame of the row at `base`; its quaternion (w, x, y, z), local to world, is normalised here."""
    w = rows[base + ROTATION_C]
    i = rows[base + ROTATION_C + 1]
    j = rows[base + ROTATION_C + 2]
    k = rows[base + ROTATION_C + 3]
    s = 2.0 / wp.max(w * w + i * i + j * j + k * k, 1.0e-30)
    cx = rows[base + TRANSLATION_C]
    cy = rows[base + TRANSLATION_C + 1]
    cz = rows[base + TRANSLATION_C + 2]
    f = Frame()
    f.xx = 1.0 - s * (j * j + k * k)
    f.xy = s * (i * j + w * k)
    f.xz = s * (i * k - w * j)
    f.yx = s * (i * j - w * k)
    f.yy = 1.0 - s * (i * i + k * k)
    f.yz = s * (j * k + w * i)
    f.zx = s * (i * k + w * j)
    f.zy = s * (j * k - w * i)
    f.zz = 1.0 - s * (i * i + j * j)
    f.x = -(f.xx * cx + f.xy * cy + f.xz * cz)
    f.y = -(f.yx * cx + f.yy * cy + f.yz * cz)
    f.z = -(f.zx * cx + f.zy * cy + f.zz * cz)
    return f


@wp.func
def to_local(f: Frame, x: float, y: float, z: float):
    """World point to local point."""
    return (
        f.xx * x + f.xy * y + f.xz * z + f.x,
        f.yx * x + f.yy * y + f.yz * z + f.y,
        f.zx * x + f.zy * y + f.zz * z + f.z,
    )


@wp.func
def to_world_direction(f: Frame, x: float, y: float, z: float):
    """Local direction to world direction."""
    return (
        f.xx * x + f.yx * y + f.zx * z,
        f.xy * x + f.yy * y + f.zy * z,
        f.xz * x + f.yz * y + f.zz * z,
    )


@wp.func
def rotation_from_axis_angle(x: float, y: float, z: float) -> wp.quat:
    """Unit quaternion exp(w / 2), regular at zero (superfrustum.md, "Frames and units")."""
    square = x * x + y * y + z * z
    if square < 1.0e-4:
        half = 0.5 - square * (1.0 / 48.0)
        return wp.quat(x * half, y * half, z * half, 1.0 - square * 0.125 * (1.0 - square * (1.0 / 48.0)))
    angle = wp.sqrt(square)
    s = wp.sin(0.5 * angle) / angle
    return wp.quat(x * s, y * s, z * s, wp.cos(0.5 * angle))
