"""How many primitives hold each point: only blocks that a primitive's surface passes are asked point by point."""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

import warp as wp

from ..primitives import family
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import VECTOR_OPTIONS, launch
from ..vector_math import larger
from .culling import MARGIN, BlockBounds, bound_primitives
from .evaluate import BLOCK_SECONDS
from .frame import Frame, to_local
from .points import BLOCK_C, PointBlocks, padded_count
from .primitive_set import PrimitiveSet

SURFACE_SHARE = 0.1
"""Guess of the share of the blocks that a primitive's surface passes."""


@cached_kernel
def count_kernel(name: str) -> wp.Kernel:
    """The kernel that counts primitives of the family `name`; values are those of `evaluate_primitives_kernel`."""
    module = f"resfit.kernels.field.containment_count.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    entry = family(name)
    table, sdf = entry.table, entry.sdf
    fast = entry.fast or entry.sdf
    has_seam_zone = entry.seam_zone is not None
    seam_zone = entry.seam_zone or entry.sdf

    @wp.kernel(module=module)
    def count_holders_kernel(
        first: int,
        x: wp.array[float],
        y: wp.array[float],
        z: wp.array[float],
        frames: wp.array[Frame],
        tables: wp.array[table],
        middle: wp.array[float],
        reach: wp.array[float],
        stride: int,
        run: wp.vec2i,
        # outputs
        out_count: wp.array[int],
    ):
        block = first + wp.tid()
        base = block * BLOCK_C
        if run[0] == 0:
            for j in range(BLOCK_C):
                out_count[base + j] = 0
        for k in range(run[0], run[1]):
            at = middle[k * stride + block]
            spread = reach[k * stride + block] + MARGIN
            if at + spread < 0.0:
                for j in range(BLOCK_C):
                    out_count[base + j] += 1
            elif at - spread < 0.0:
                f = frames[k]
                s = tables[k]
                slow = float(0.0)
                if wp.static(has_seam_zone):
                    for j in range(BLOCK_C):
                        px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                        slow += larger(seam_zone(s, px, py, pz), 0.0)
                if slow > 0.0:
                    for j in range(BLOCK_C):
                        px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                        out_count[base + j] += wp.where(sdf(s, px, py, pz) < 0.0, 1, 0)
                else:
                    for j in range(BLOCK_C):
                        px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                        out_count[base + j] += wp.where(fast(s, px, py, pz) < 0.0, 1, 0)

    return count_holders_kernel


def count_containing(primitives: PrimitiveSet, blocks: PointBlocks, bounds: BlockBounds) -> wp.array:
    """How many primitives, each alone and ungated, hold each point: (padded points,) int32.

    Args:
        primitives: at least one.
        blocks: the points.
        bounds: of the blocks.
    """
    count = wp.empty(blocks.x.shape[0], dtype=int, device=blocks.device)
    middle, reach = bound_primitives(primitives, bounds)
    for run in primitives.runs:
        launch(
            count_kernel(run.family.name),
            blocks.block_count,
            [
                blocks.x,
                blocks.y,
                blocks.z,
                primitives.frames,
                primitives.tables[run.family.name],
                middle,
                reach,
                padded_count(blocks.block_count),
                wp.vec2i(run.begin, run.end),
            ],
            [count],
            blocks.device,
            seconds_per_thread=SURFACE_SHARE * BLOCK_SECONDS * run.count,
        )
    return count
