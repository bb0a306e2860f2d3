"""Nearest primitive of a point, the runner-up, and their shares in the union.

Each block of points is shown only the primitives that can matter there: those that can change the union, and those
that can cover a point (be below a given distance), of which the second nearest is wanted. Everything stays on the
device; owners are found anew at every step of a refinement, lists only when the sharpness rises.
"""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import warp as wp

from ..field.block import BlockFloats, BlockIntegers, block_functions, launch_runs
from ..field.combine import FAR, gated, quarter_inverse, smooth_minimum
from ..field.culling import BlockBounds, Lists, bound_primitives, lists_argument
from ..field.points import BLOCK_C, PointBlocks, Points
from ..field.primitive_set import Primitives, PrimitiveSet
from ..primitives import family
from ..rows import BLEND_C, GATE_C, ROW_C
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import VECTOR_OPTIONS, launch
from ..vector_math import larger, smaller
from .residuals import COVERED_C

wp.set_module_options(VECTOR_OPTIONS)

MARGIN = wp.constant(1.0e-5)
"""Slack for the float32 error of the bounds."""


@wp.struct
class Owners:
    """Arrays of a `NearestPrimitives` that a loss reads, as an argument of kernels."""

    field: wp.array[float]
    owner: wp.array[int]
    second: wp.array[int]
    runner_up: wp.array[float]
    share: wp.array[float]
    live: wp.array[int]


@dataclass(frozen=True)
class NearestPrimitives:
    """Union and nearest primitives at each point or padding; distances are normalised, negative inside."""

    field: wp.array
    """(n,) smooth union."""
    owner: wp.array
    """(n,) int32, the primitive with the smallest distance."""
    nearest: wp.array
    """(n,) that distance, gated."""
    second: wp.array
    """(n,) int32, the primitive with the second smallest distance; 0 where `runner_up` is FAR."""
    runner_up: wp.array
    """(n,) that distance, gated. FAR or not the second smallest where it neither blends nor covers."""
    share: wp.array
    """(n,) in [1/2, 1]: derivative of the union to the owner, as far as these two go; the second has the rest."""
    ids: wp.array
    """(block_count * primitive_count,) int32: primitives shown to each block, in list order; negative is none."""
    counts: wp.array
    """(block_count,) int32: how many."""
    live: wp.array
    """(block_count,) int32: blocks with 0 are left out, and their other values are stale."""
    middle: wp.array
    """(primitive_count * padded block_count,) each primitive at the blocks' centres."""
    reach: wp.array
    """The same layout: how far it may be from that within the block."""

    @cached_property
    def lists(self) -> Any:
        """The lists as one argument of a kernel: a `Lists`."""
        return lists_argument(self.ids, self.counts)

    @cached_property
    def argument(self) -> Any:
        """The owners as one argument of a kernel: an `Owners`."""
        owners = Owners()
        owners.field, owners.owner, owners.second = self.field, self.owner, self.second
        owners.runner_up, owners.share, owners.live = self.runner_up, self.share, self.live
        return owners


def nearest_primitive_arrays(
    primitive_count: int, blocks: PointBlocks, bounds: BlockBounds
) -> NearestPrimitives:
    """Arrays for points that are looked at often: all blocks live, everything else uninitialised."""
    device, size = blocks.device, blocks.x.shape[0]
    spheres = primitive_count * bounds.x.shape[0]

    def floats(count: int) -> wp.array:
        return wp.empty(max(1, count), dtype=float, device=device)

    def integers(count: int) -> wp.array:
        return wp.empty(max(1, count), dtype=int, device=device)

    return NearestPrimitives(
        field=floats(size),
        owner=integers(size),
        nearest=floats(size),
        second=integers(size),
        runner_up=floats(size),
        share=floats(size),
        ids=integers(blocks.block_count * primitive_count),
        counts=integers(blocks.block_count),
        live=wp.full(blocks.block_count, 1, dtype=int, device=device),
        middle=floats(spheres),
        reach=floats(spheres),
    )


@wp.kernel
def list_candidates_kernel(
    first: int,
    rows: wp.array[float],
    middle: wp.array[float],
    reach: wp.array[float],
    betas: wp.array[float],
    live: wp.array[int],
    primitive_count: int,
    stride: int,
    # outputs
    out_ids: wp.array[int],
    out_counts: wp.array[int],
):
    """List the primitives that can change one block's union, or cover one of its points.

    As in `culling`, folding bounds bounds the fold; `begin` is the last primitive that wipes out all before it.
    """
    block = first + wp.tid()
    if live[block] == 0:
        out_counts[block] = 0
        return
    covered = COVERED_C / betas[0] + MARGIN
    listed = int(0)
    begin = int(0)
    low = float(FAR)
    high = float(FAR)
    base = block * primitive_count
    for k in range(primitive_count):
        gate = rows[k * ROW_C + GATE_C]
        blend = rows[k * ROW_C + BLEND_C]
        at = gate * middle[k * stride + block] + 1.0 - gate
        spread = gate * reach[k * stride + block] + MARGIN
        if at - spread < high + blend:
            if low >= at + spread + blend:
                begin = k
            quarter = quarter_inverse(blend)
            low = smooth_minimum(low, at - spread, blend, quarter)
            high = smooth_minimum(high, at + spread, blend, quarter)
            # Negative for now where it covers nothing and may still be wiped out.
            out_ids[base + listed] = wp.where(at - spread < covered, k, -1 - k)
            listed += 1
        elif at - spread < covered:
            out_ids[base + listed] = k
            listed += 1
    count = int(0)
    for n in range(listed):
        k = out_ids[base + n]
        if k < 0:
            k = -1 - k
            if k < begin:
                continue
        out_ids[base + count] = k
        count += 1
    out_counts[block] = count


@cached_kernel
def find_owners_kernel(name: str) -> wp.Kernel:
    """The kernel of the family `name` that folds a run of primitives into one block's union and two nearest."""
    module = f"resfit.kernels.refine.nearest_primitives.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    table = family(name).table
    block_distances = block_functions(name).distances

    @wp.kernel(module=module)
    def fold_owners_kernel(
        first: int,
        primitives: Primitives,
        tables: wp.array[table],
        points: Points,
        lists: Lists,
        live: wp.array[int],
        # outputs
        out_field: wp.array[float],
        out_owner: wp.array[int],
        out_nearest: wp.array[float],
        out_second: wp.array[int],
        out_runner_up: wp.array[float],
        out_share: wp.array[float],
    ):
        block = first + wp.tid()
        if live[block] == 0:
            return
        base = block * BLOCK_C
        distance = BlockFloats()
        field = BlockFloats()
        nearest = BlockFloats()
        runner_up = BlockFloats()
        share = BlockFloats()
        owner = BlockIntegers()
        second = BlockIntegers()
        if primitives.begin == 0:
            for j in range(BLOCK_C):
                field[j] = FAR
                nearest[j] = FAR
                runner_up[j] = FAR
        else:
            for j in range(BLOCK_C):
                field[j] = out_field[base + j]
                nearest[j] = out_nearest[base + j]
                runner_up[j] = out_runner_up[base + j]
                share[j] = out_share[base + j]
                owner[j] = out_owner[base + j]
                second[j] = out_second[base + j]
        for n in range(lists.counts[block]):
            k = lists.ids[block * primitives.count + n]
            if k >= primitives.begin and k < primitives.end:
                block_distances(points, base, primitives.frames[k], tables[k], distance)
                blend = primitives.rows[k * ROW_C + BLEND_C]
                gate = primitives.rows[k * ROW_C + GATE_C]
                quarter = quarter_inverse(blend)
                for j in range(BLOCK_C):
                    value = gated(distance[j], gate)
                    field[j] = smooth_minimum(field[j], value, blend, quarter)
                    leads = value < nearest[j]
                    follows = value < runner_up[j]
                    # As k counts up, the later of the two nearest is k whenever k is one of them: `share` holds its
                    # blend until the end.
                    share[j] = wp.where(follows, blend, share[j])
                    runner_up[j] = smaller(runner_up[j], larger(value, nearest[j]))
                    nearest[j] = smaller(nearest[j], value)
                    second[j] = wp.where(leads, owner[j], wp.where(follows, k, second[j]))
                    owner[j] = wp.where(leads, k, owner[j])
        if primitives.end == primitives.count:
            for j in range(BLOCK_C):
                gap = runner_up[j] - nearest[j]
                share[j] = smaller(0.5 + 0.5 * gap / larger(share[j], 1.0e-9), 1.0)
        for j in range(BLOCK_C):
            out_field[base + j] = field[j]
            out_nearest[base + j] = nearest[j]
            out_runner_up[base + j] = runner_up[j]
        for j in range(BLOCK_C):
            out_share[base + j] = share[j]
            out_owner[base + j] = owner[j]
            out_second[base + j] = second[j]

    return fold_owners_kernel


def list_candidates(
    primitives: PrimitiveSet,
    blocks: PointBlocks,
    bounds: BlockBounds,
    betas: wp.array,
    out: NearestPrimitives,
) -> None:
    """Show each live block the primitives that can matter there.

    Args:
        primitives: the assembly, at least one primitive.
        blocks: the points, neighbours in the list being neighbours in space.
        bounds: of the blocks.
        betas: (primitive_count,) sharpness of the occupancy, all alike: it says how near is covered.
        out: from `nearest_primitive_arrays`.
    """
    device, count, stride = blocks.device, len(primitives), bounds.x.shape[0]
    bound_primitives(primitives, bounds, (out.middle, out.reach))
    launch(
        list_candidates_kernel,
        blocks.block_count,
        [primitives.rows, out.middle, out.reach, betas, out.live, count, stride],
        [out.ids, out.counts],
        device,
        seconds_per_thread=5e-9 * count,
    )


def find_owners(primitives: PrimitiveSet, blocks: PointBlocks, out: NearestPrimitives) -> None:
    """Owners of all points of live blocks, among the primitives that those are shown.

    Args:
        primitives: the assembly, at least one primitive.
        blocks: the points.
        out: with lists from `list_candidates`.
    """
    launch_runs(
        find_owners_kernel,
        primitives,
        blocks.block_count,
        [blocks.points, out.lists, out.live],
        [out.field, out.owner, out.nearest, out.second, out.runner_up, out.share],
        5e-8,
    )
