"""Dropping the primitives of a block's list that cannot matter there soon.

Lists from bounding spheres are long: a block's points are known only to lie in its sphere. Once the union is known at
every point, so is what each listed primitive would have to move to change it.
"""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

import warp as wp

from ..field.combine import gated
from ..field.frame import Frame, to_local
from ..field.points import BLOCK_C, PointBlocks
from ..field.primitive_set import PrimitiveSet
from ..primitives import family
from ..rows import BLEND_C, GATE_C, ROW_C
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import VECTOR_OPTIONS, launch
from ..vector_math import larger
from .nearest_primitives import COVERED_C, NearestPrimitives
from .residual_points import MOVE


@cached_kernel
def prune_lists_kernel(name: str) -> wp.Kernel:
    """The kernel of the family `name` that goes through one block's list."""
    module = f"resfit.kernels.refine.prune_lists.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    entry = family(name)
    table, sdf = entry.table, entry.sdf

    @wp.kernel(module=module)
    def drop_idle_primitives_kernel(
        first: int,
        x: wp.array[float],
        y: wp.array[float],
        z: wp.array[float],
        frames: wp.array[Frame],
        tables: wp.array[table],
        rows: wp.array[float],
        field: wp.array[float],
        live: wp.array[int],
        counts: wp.array[int],
        betas: wp.array[float],
        primitive_count: int,
        run: wp.vec2i,
        # outputs
        ids: wp.array[int],
    ):
        block = first + wp.tid()
        if live[block] == 0:
            return
        base = block * BLOCK_C
        covered = COVERED_C / betas[0] + MOVE
        for n in range(counts[block]):
            slot = block * primitive_count + n
            k = ids[slot]
            if k >= run[0] and k < run[1]:
                f = frames[k]
                s = tables[k]
                gate = rows[k * ROW_C + GATE_C]
                # The union and the primitive may both move.
                margin = rows[k * ROW_C + BLEND_C] + 2.0 * MOVE
                near = int(0)
                for j in range(BLOCK_C):
                    px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                    value = gated(sdf(s, px, py, pz), gate)
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
    for run in primitives.runs:
        launch(
            prune_lists_kernel(run.family.name),
            blocks.block_count,
            [
                *(blocks.x, blocks.y, blocks.z, primitives.frames, primitives.tables[run.family.name]),
                *(primitives.rows, out.field, out.live, out.counts, betas, len(primitives)),
                wp.vec2i(run.begin, run.end),
            ],
            [out.ids],
            blocks.device,
            seconds_per_thread=5e-8 * run.count,
        )
