"""Winding numbers by adding up the solid angles of all faces, for meshes whose faces lie across each other.

A hierarchy in which one dipole stands for distant faces has to open nearly all of its boxes there, and takes many times
as long as this plain sum. Not differentiable.
"""

from __future__ import annotations

import math

import warp as wp

from ..field.points import BLOCK, BLOCK_C, PointBlocks
from ..runtime.launch import VECTOR_OPTIONS, launch
from ..vector_math import HALF_PI, PI, atan_ratio, larger, smaller
from .mesh_query import MeshQuery

wp.set_module_options(VECTOR_OPTIONS)

TURN = wp.constant(0.5 / math.pi)
"""Turns by twice an angle of a face, which is half its solid angle: 2 / (4 pi)."""


def summed_winding_numbers(query: MeshQuery, points: PointBlocks) -> wp.array:
    """Winding number of the mesh about each of n points, to about 1e-5; (n,) float32.

    Takes 2 ns a face and point.
    """
    winding = wp.zeros(len(points.x), dtype=float, device=query.device)
    launch(
        add_solid_angles_kernel,
        points.block_count,
        [query.vertices, query.faces, points.x, points.y, points.z],
        [winding],
        query.device,
        seconds_per_thread=2e-9 * BLOCK * query.face_count,
    )
    return winding[: points.count]


@wp.func
def half_solid_angle(across: float, along: float) -> float:
    """atan2(across, along), to 1e-7; 0 where both are 0."""
    height, width = wp.abs(across), wp.abs(along)
    r = smaller(height, width) / larger(larger(height, width), 1.0e-30)
    angle = r * atan_ratio(r * r)
    angle = wp.where(height > width, HALF_PI - angle, angle)
    angle = wp.where(along < 0.0, PI - angle, angle)
    return wp.where(across < 0.0, -angle, angle)


@wp.kernel
def add_solid_angles_kernel(
    first: int,
    vertices: wp.array[wp.vec3],
    faces: wp.array[int],
    x: wp.array[float],
    y: wp.array[float],
    z: wp.array[float],
    # outputs
    out_winding: wp.array[float],
):
    """Winding numbers of one block of points, face after face (Van Oosterom and Strackee)."""
    base = (first + wp.tid()) * BLOCK_C
    for f in range(faces.shape[0] // 3):
        p, q, r = vertices[faces[3 * f]], vertices[faces[3 * f + 1]], vertices[faces[3 * f + 2]]
        px, py, pz = p[0], p[1], p[2]
        qx, qy, qz = q[0], q[1], q[2]
        rx, ry, rz = r[0], r[1], r[2]
        for j in range(BLOCK_C):
            i = base + j
            ax, ay, az = px - x[i], py - y[i], pz - z[i]
            bx, by, bz = qx - x[i], qy - y[i], qz - z[i]
            cx, cy, cz = rx - x[i], ry - y[i], rz - z[i]
            a = wp.sqrt(ax * ax + ay * ay + az * az)
            b = wp.sqrt(bx * bx + by * by + bz * bz)
            c = wp.sqrt(cx * cx + cy * cy + cz * cz)
            volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
            ab, bc, ca = ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz, cx * ax + cy * ay + cz * az
            out_winding[i] = out_winding[i] + TURN * half_solid_angle(
                volume, a * b * c + ab * c + bc * a + ca * b
            )
