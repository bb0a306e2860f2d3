"""Dropping the primitives of a block's list that cannot matter there soon.

Lists from bounding spheres are long: a block's points are known only to lie in its sphere. Once the union is known at
every point, so is what each listed primitive would have to move to change it.
"""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

import warp as wp

from ..field.block import BlockFloats, block_functions, launch_runs
from ..field.combine import gated
from ..field.points import BLOCK_C, PointBlocks, Points
from ..field.primitive_set import Primitives, PrimitiveSet
from ..primitives import family
from ..rows import BLEND_C, GATE_C, ROW_C
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import VECTOR_OPTIONS
from ..vector_math import larger
from .nearest_primitives import NearestPrimitives
from .residual_points import MOVE
from .residuals import COVERED_C


@cached_kernel
def prune_lists_kernel(name: str) -> wp.Kernel:
    """The kernel of the family `name` that goes through one block's list."""
    module = f"resfit.kernels.refine.prune_lists.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    table = family(name).table
    block_distances = block_functions(name).distances

    @wp.kernel(module=module)
    def drop_idle_primitives_kernel(
        first: int,
        primitives: Primitives,
        tables: wp.array[table],
        points: Points,
        field: wp.array[float],
        live: wp.array[int],
        counts: wp.array[int],
        betas: wp.array[float],
        # outputs
        ids: wp.array[int],
    ):
        block = first + wp.tid()
        if live[block] == 0:
            return
        base = block * BLOCK_C
        distance = BlockFloats()
        covered = COVERED_C / betas[0] + MOVE
        for n in range(counts[block]):
            slot = block * primitives.count + n
            k = ids[slot]
            if k >= primitives.begin and k < primitives.end:
                gate = primitives.rows[k * ROW_C + GATE_C]
                # The union and the primitive may both move.
                margin = primitives.rows[k * ROW_C + BLEND_C] + 2.0 * MOVE
                block_distances(points, base, primitives.frames[k], tables[k], distance)
                near = int(0)
                for j in range(BLOCK_C):
                    value = gated(distance[j], gate)
                    near += wp.where(value < larger(field[base + j] + margin, covered), 1, 0)
                if near == 0:
                    ids[slot] = -1 - k

    return drop_idle_primitives_kernel


def prune_lists(
    primitives: PrimitiveSet, blocks: PointBlocks, betas: wp.array, out: NearestPrimitives
) -> None:
    """Take those primitives off the lists that change nothing while none moves by more than MOVE.

    Args:
        primitives: the assembly.
        blocks: the points.
        betas: (primitive_count,) sharpness of the occupancy, all alike.
        out: owners of the points as they are; `ids` is changed.
    """
    launch_runs(
        prune_lists_kernel,
        primitives,
        blocks.block_count,
        [blocks.points, out.field, out.live, out.counts, betas],
        [out.ids],
        5e-8,
    )
