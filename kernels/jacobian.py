"""Derivatives of one primitive at points: the shared middle of every kernel that needs a gradient.

A Jacobian row has TANGENT columns (see `rows`): local translation, local rotation, shape. Moving the primitive by d
moves the local point q by -d, turning it by w moves q by -(w x q): hence -g and g x q of the local gradient g.
"""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

from collections.abc import Sequence
from functools import cache

import numpy as np
import warp as wp

from .frame import Frame, to_local
from .launch import VECTOR_OPTIONS, launch
from .primitive_set import PrimitiveSet
from .primitives import family
from .rows import TANGENT

TANGENT_C = wp.constant(TANGENT)


@cache
def jacobian_kernel(name: str) -> wp.Kernel:
    """The kernel of the family `name` that writes one Jacobian row a point; scalar, for checks and small jobs."""
    module = f"resfit.kernels.jacobian.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    entry = family(name)
    sdf_grad, table = entry.sdf_grad, entry.table

    @wp.kernel(module=module)
    def write_jacobian_kernel(
        first: int,
        points: wp.array[wp.vec3],
        owners: wp.array[int],
        frames: wp.array[Frame],
        tables: wp.array[table],
        run: wp.vec2i,
        # outputs
        out_values: wp.array[float],
        out_rows: wp.array2d[float],
    ):
        i = first + wp.tid()
        k = owners[i]
        if k >= run[0] and k < run[1]:
            p = points[i]
            x, y, z = to_local(frames[k], p[0], p[1], p[2])
            f, gx, gy, gz, s0, s1, s2, s3, s4, s5, s6, s7 = sdf_grad(tables[k], x, y, z)
            out_values[i] = f
            out_rows[i, 0] = -gx
            out_rows[i, 1] = -gy
            out_rows[i, 2] = -gz
            out_rows[i, 3] = gy * z - gz * y
            out_rows[i, 4] = gz * x - gx * z
            out_rows[i, 5] = gx * y - gy * x
            out_rows[i, 6] = s0
            out_rows[i, 7] = s1
            out_rows[i, 8] = s2
            out_rows[i, 9] = s3
            out_rows[i, 10] = s4
            out_rows[i, 11] = s5
            out_rows[i, 12] = s6
            out_rows[i, 13] = s7

    return write_jacobian_kernel


def jacobian(
    primitives: PrimitiveSet, points: np.ndarray, owners: Sequence[int] | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Value and Jacobian row of each point's own primitive.

    Args:
        primitives: the assembly.
        points: (n, 3), normalised frame.
        owners: (n,), the primitive that each point belongs to.

    Returns:
        Signed distances (n,), negative inside, and rows (n, TANGENT) float32.
    """
    count = len(points)
    values = wp.zeros(max(1, count), dtype=float, device=primitives.device)
    rows = wp.zeros((max(1, count), TANGENT), dtype=float, device=primitives.device)
    if count:
        positions = wp.array(np.asarray(points, np.float32), dtype=wp.vec3, device=primitives.device)
        ids = wp.array(np.asarray(owners, np.int32), dtype=int, device=primitives.device)
        for run in primitives.runs:
            launch(
                jacobian_kernel(run.family.name),
                count,
                [
                    positions,
                    ids,
                    primitives.frames,
                    primitives.tables[run.family.name],
                    wp.vec2i(run.begin, run.end),
                ],
                [values, rows],
                primitives.device,
                seconds_per_thread=8e-8,
            )
    return values.numpy()[:count], rows.numpy()[:count]
