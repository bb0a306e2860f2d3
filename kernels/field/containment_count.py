"""Number of primitives that contain each point: only blocks that a surface passes are asked by point."""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

import warp as wp

from ..primitives import family
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import VECTOR_OPTIONS
from .block import BlockFloats, block_functions, launch_runs
from .culling import MARGIN, BlockBounds, bound_primitives
from .evaluate import BLOCK_SECONDS
from .points import BLOCK_C, PointBlocks, Points, padded_count
from .primitive_set import Primitives, PrimitiveSet

SURFACE_SHARE = 0.1
"""Guess of the share of the blocks that a primitive's surface passes."""


@cached_kernel
def count_kernel(name: str) -> wp.Kernel:
    """The kernel that counts primitives of the family `name`; values are those of `evaluate_primitives_kernel`."""
    module = f"resfit.kernels.field.containment_count.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    table = family(name).table
    block_distances = block_functions(name).distances

    @wp.kernel(module=module)
    def count_holders_kernel(
        first: int,
        primitives: Primitives,
        tables: wp.array[table],
        points: Points,
        middle: wp.array[float],
        reach: wp.array[float],
        stride: int,
        # outputs
        out_count: wp.array[int],
    ):
        block = first + wp.tid()
        base = block * BLOCK_C
        distance = BlockFloats()
        if primitives.begin == 0:
            for j in range(BLOCK_C):
                out_count[base + j] = 0
        for k in range(primitives.begin, primitives.end):
            at = middle[k * stride + block]
            spread = reach[k * stride + block] + MARGIN
            if at + spread < 0.0:
                for j in range(BLOCK_C):
                    out_count[base + j] += 1
            elif at - spread < 0.0:
                block_distances(points, base, primitives.frames[k], tables[k], distance)
                for j in range(BLOCK_C):
                    out_count[base + j] += wp.where(distance[j] < 0.0, 1, 0)

    return count_holders_kernel


def count_containing(primitives: PrimitiveSet, blocks: PointBlocks, bounds: BlockBounds) -> wp.array:
    """Number of primitives, each alone and ungated, that contain each point: (padded points,) int32.

    Args:
        primitives: at least one.
        blocks: the points.
        bounds: of the blocks.
    """
    count = wp.empty(blocks.x.shape[0], dtype=int, device=blocks.device)
    middle, reach = bound_primitives(primitives, bounds)
    launch_runs(
        count_kernel,
        primitives,
        blocks.block_count,
        [blocks.points, middle, reach, padded_count(blocks.block_count)],
        [count],
        SURFACE_SHARE * BLOCK_SECONDS,
    )
    return count
