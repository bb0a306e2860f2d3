"""The union's gradient in space: what surface projection and shading need."""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

import numpy as np
import warp as wp

from ..primitives import family
from ..rows import BLEND_C, GATE_C, ROW_C, Derivatives
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import VECTOR_OPTIONS, launch
from ..vector_math import larger
from .combine import FAR, gated, quarter_inverse, smooth_minimum, smooth_minimum_share
from .culling import ActiveLists, BlockBounds, active_lists
from .frame import Frame, to_local, to_world_direction
from .points import BLOCK_C, PointBlocks, point_blocks
from .primitive_set import PrimitiveSet

BLOCK_SECONDS = 3e-7
"""One primitive over one block of points, on one core."""


@cached_kernel
def gradient_kernel(name: str) -> wp.Kernel:
    """The kernel that folds value and gradient of the union over a run of primitives of the family `name`."""
    module = f"resfit.kernels.field.gradient.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    entry = family(name)
    table = entry.table
    sdf_grad = entry.sdf_grad
    fast_grad = entry.fast_grad or entry.sdf_grad
    has_seam_zone = entry.seam_zone is not None
    seam_zone = entry.seam_zone or entry.sdf

    @wp.func
    def fold(
        i: int,
        d: Derivatives,
        f: Frame,
        gate: float,
        blend: float,
        quarter: float,
        field: wp.array[float],
        gx: wp.array[float],
        gy: wp.array[float],
        gz: wp.array[float],
    ):
        before = field[i]
        after = gated(d[0], gate)
        wx, wy, wz = to_world_direction(f, d[1], d[2], d[3])
        keep = smooth_minimum_share(before, after, quarter)
        take = (1.0 - keep) * gate
        field[i] = smooth_minimum(before, after, blend, quarter)
        gx[i] = keep * gx[i] + take * wx
        gy[i] = keep * gy[i] + take * wy
        gz[i] = keep * gz[i] + take * wz

    @wp.kernel(module=module)
    def fold_gradient_kernel(
        first: int,
        x: wp.array[float],
        y: wp.array[float],
        z: wp.array[float],
        frames: wp.array[Frame],
        tables: wp.array[table],
        rows: wp.array[float],
        ids: wp.array[int],
        counts: wp.array[int],
        primitive_count: int,
        run: wp.vec2i,
        # outputs
        out_field: wp.array[float],
        out_x: wp.array[float],
        out_y: wp.array[float],
        out_z: wp.array[float],
    ):
        block = first + wp.tid()
        base = block * BLOCK_C
        if run[0] == 0:
            for j in range(BLOCK_C):
                out_field[base + j] = FAR
                out_x[base + j] = 0.0
                out_y[base + j] = 0.0
                out_z[base + j] = 0.0
        for n in range(counts[block]):
            k = ids[block * primitive_count + n]
            if k >= run[0] and k < run[1]:
                f = frames[k]
                s = tables[k]
                blend = rows[k * ROW_C + BLEND_C]
                gate = rows[k * ROW_C + GATE_C]
                quarter = quarter_inverse(blend)
                slow = float(0.0)
                if wp.static(has_seam_zone):
                    for j in range(BLOCK_C):
                        px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                        slow += larger(seam_zone(s, px, py, pz), 0.0)
                if slow > 0.0:
                    for j in range(BLOCK_C):
                        px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                        d = sdf_grad(s, px, py, pz)
                        fold(base + j, d, f, gate, blend, quarter, out_field, out_x, out_y, out_z)
                else:
                    for j in range(BLOCK_C):
                        px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                        d = fast_grad(s, px, py, pz)
                        fold(base + j, d, f, gate, blend, quarter, out_field, out_x, out_y, out_z)

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
    for run in primitives.runs:
        launch(
            gradient_kernel(run.family.name),
            blocks.block_count,
            [
                blocks.x,
                blocks.y,
                blocks.z,
                primitives.frames,
                primitives.tables[run.family.name],
                primitives.rows,
                lists.ids,
                lists.counts,
                len(primitives),
                wp.vec2i(run.begin, run.end),
            ],
            outputs,
            blocks.device,
            seconds_per_thread=0.3 * BLOCK_SECONDS * run.count,
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
