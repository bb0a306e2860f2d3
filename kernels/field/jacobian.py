"""Derivatives of one primitive at points: the shared middle of every kernel that needs a gradient.

A Jacobian row has TANGENT columns (see `rows`): local translation, local rotation, shape. Moving the primitive by d
moves the local point q by -d, turning it by w moves q by -(w x q): hence -g and g x q of the local gradient g.
"""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..primitives import family
from ..rows import TANGENT, Derivatives
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import VECTOR_OPTIONS, launch
from .frame import Frame, to_local
from .primitive_set import PrimitiveSet

TANGENT_C = wp.constant(TANGENT)
JacobianRow = wp.types.vector(length=TANGENT, dtype=float)


@wp.func
def jacobian_row(x: float, y: float, z: float, d: Derivatives) -> JacobianRow:
    """The row of a local point from the field's derivatives there."""
    return JacobianRow(
        -d[1],
        -d[2],
        -d[3],
        d[2] * z - d[3] * y,
        d[3] * x - d[1] * z,
        d[1] * y - d[2] * x,
        d[4],
        d[5],
        d[6],
        d[7],
        d[8],
        d[9],
        d[10],
        d[11],
    )


@cached_kernel
def jacobian_kernel(name: str) -> wp.Kernel:
    """The kernel of the family `name` that writes one Jacobian row a point; scalar, for checks and small jobs."""
    module = f"resfit.kernels.field.jacobian.{name}"
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
            d = sdf_grad(tables[k], x, y, z)
            row = jacobian_row(x, y, z, d)
            out_values[i] = d[0]
            for m in range(TANGENT_C):
                out_rows[i, m] = row[m]

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
