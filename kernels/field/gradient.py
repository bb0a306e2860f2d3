"""The union's gradient in space: what surface projection and shading need."""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

import numpy as np
import warp as wp

from ..primitives import family
from ..rows import BLEND_C, GATE_C, ROW_C
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import VECTOR_OPTIONS
from .block import block_functions, launch_runs
from .combine import FAR, gated, quarter_inverse, smooth_minimum, smooth_minimum_share
from .culling import ActiveLists, BlockBounds, Lists, active_lists
from .frame import to_world_direction
from .points import BLOCK, BLOCK_C, PointBlocks, Points, point_blocks
from .primitive_set import Primitives, PrimitiveSet

BLOCK_SECONDS = 3e-7
"""One primitive over one block of points, on one core."""


@cached_kernel
def gradient_kernel(name: str) -> wp.Kernel:
    """The kernel that folds value and gradient of the union over a run of primitives of the family `name`."""
    module = f"resfit.kernels.field.gradient.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    table = family(name).table
    matrix = wp.types.matrix(shape=(4, BLOCK), dtype=float)
    block_gradients = block_functions(name, BLOCK, 4).derivatives

    @wp.kernel(module=module)
    def fold_gradient_kernel(
        first: int,
        primitives: Primitives,
        tables: wp.array[table],
        points: Points,
        lists: Lists,
        # outputs
        out_field: wp.array[float],
        out_x: wp.array[float],
        out_y: wp.array[float],
        out_z: wp.array[float],
    ):
        block = first + wp.tid()
        base = block * BLOCK_C
        d = matrix()
        if primitives.begin == 0:
            for j in range(BLOCK_C):
                out_field[base + j] = FAR
                out_x[base + j] = 0.0
                out_y[base + j] = 0.0
                out_z[base + j] = 0.0
        for n in range(lists.counts[block]):
            k = lists.ids[block * primitives.count + n]
            if k >= primitives.begin and k < primitives.end:
                f = primitives.frames[k]
                blend = primitives.rows[k * ROW_C + BLEND_C]
                gate = primitives.rows[k * ROW_C + GATE_C]
                quarter = quarter_inverse(blend)
                block_gradients(points, base, f, tables[k], d)
                for j in range(BLOCK_C):
                    i = base + j
                    before = out_field[i]
                    after = gated(d[0, j], gate)
                    wx, wy, wz = to_world_direction(f, d[1, j], d[2, j], d[3, j])
                    keep = smooth_minimum_share(before, after, quarter)
                    take = (1.0 - keep) * gate
                    out_field[i] = smooth_minimum(before, after, blend, quarter)
                    out_x[i] = keep * out_x[i] + take * wx
                    out_y[i] = keep * out_y[i] + take * wy
                    out_z[i] = keep * out_z[i] + take * wz

    return fold_gradient_kernel


def union_gradient_at(
    primitives: PrimitiveSet,
    blocks: PointBlocks,
    bounds: BlockBounds | None = None,
    lists: ActiveLists | None = None,
) -> tuple[wp.array, wp.array, wp.array, wp.array]:
    """Field and gradient (x, y, z) of the smooth union, each (padded points,); FAR and 0 where there is nothing."""
    size = max(1, blocks.x.shape[0])
    outputs = tuple(wp.empty(size, dtype=float, device=blocks.device) for _ in range(4))
    if not len(primitives):
        outputs[0].fill_(FAR)
        for output in outputs[1:]:
            output.zero_()
        return outputs
    lists = lists or active_lists(primitives, blocks, bounds)
    launch_runs(
        gradient_kernel,
        primitives,
        blocks.block_count,
        [blocks.points, lists.argument],
        outputs,
        0.3 * BLOCK_SECONDS,
    )
    return outputs


def evaluate_gradient(primitives: PrimitiveSet, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signed distance and spatial gradient of the smooth union.

    Args:
        primitives: the assembly.
        points: (n, 3), normalised frame; faster if neighbours in the list are neighbours in space.

    Returns:
        Values (n,) and gradients (n, 3) float32; one-sided on creases, of length 1 almost everywhere else.
    """
    if not len(points):
        return np.zeros(0, np.float32), np.zeros((0, 3), np.float32)
    blocks = point_blocks(points, primitives.device)
    field, *gradient = union_gradient_at(primitives, blocks)
    return (
        field.numpy()[: blocks.count],
        np.stack([component.numpy()[: blocks.count] for component in gradient], axis=1),
    )
