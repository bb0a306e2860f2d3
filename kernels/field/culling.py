"""Culling of primitives per block of points: bounds at its bounding sphere, folded through the union.

Within a block's sphere of radius r about c, primitive k lies in [f_k(c) - reach, f_k(c) + reach]. The smooth union is
monotone in both arguments, so folding the bounds bounds the union; a primitive that is a blend radius above the union
so far changes nothing, and one that is a blend radius below it wipes out all that came before. Dropping those leaves
the very same values (superfrustum.md, "Lipschitz constant and reach").
"""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import warp as wp

from ..primitives import family
from ..rows import BLEND_C, GATE_C, ROW_C
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import PLAIN_OPTIONS, VECTOR_OPTIONS, launch
from ..vector_math import larger, smaller
from .block import launch_pairs, local_point
from .combine import FAR, quarter_inverse, smooth_minimum
from .points import BLOCK, BLOCK_C, PointBlocks, Points, padded_count, points_argument
from .primitive_set import Primitives, PrimitiveSet

wp.set_module_options(PLAIN_OPTIONS)

MARGIN = wp.constant(1.0e-5)
"""Slack for the float32 error of the bounds."""


@wp.struct
class Lists:
    """The primitives to evaluate in each block as an argument of kernels; see `ActiveLists`."""

    ids: wp.array[int]
    counts: wp.array[int]


def lists_argument(ids: wp.array, counts: wp.array) -> Any:
    """Lists of primitives as one argument of a kernel."""
    lists = Lists()
    lists.ids, lists.counts = ids, counts
    return lists


@dataclass(frozen=True)
class ActiveLists:
    """The primitives to evaluate in each block, in list order: ids[block * primitive_count + n], n < counts[block]."""

    ids: wp.array
    counts: wp.array

    @cached_property
    def argument(self) -> Any:
        """A `Lists`."""
        return lists_argument(self.ids, self.counts)


@wp.kernel
def bound_blocks_kernel(
    first: int,
    x: wp.array[float],
    y: wp.array[float],
    z: wp.array[float],
    # outputs
    out_x: wp.array[float],
    out_y: wp.array[float],
    out_z: wp.array[float],
    out_radius: wp.array[float],
):
    """Bounding sphere of each block: the middle of its box, and the farthest point."""
    block = first + wp.tid()
    base = block * BLOCK_C
    low_x = float(x[base])
    low_y = float(y[base])
    low_z = float(z[base])
    high_x = float(x[base])
    high_y = float(y[base])
    high_z = float(z[base])
    for j in range(BLOCK_C):
        low_x = smaller(low_x, x[base + j])
        low_y = smaller(low_y, y[base + j])
        low_z = smaller(low_z, z[base + j])
        high_x = larger(high_x, x[base + j])
        high_y = larger(high_y, y[base + j])
        high_z = larger(high_z, z[base + j])
    middle_x = 0.5 * (low_x + high_x)
    middle_y = 0.5 * (low_y + high_y)
    middle_z = 0.5 * (low_z + high_z)
    square = float(0.0)
    for j in range(BLOCK_C):
        dx = x[base + j] - middle_x
        dy = y[base + j] - middle_y
        dz = z[base + j] - middle_z
        square = larger(square, dx * dx + dy * dy + dz * dz)
    out_x[block] = middle_x
    out_y[block] = middle_y
    out_z[block] = middle_z
    out_radius[block] = wp.sqrt(square)


@cached_kernel
def bound_kernel(name: str) -> wp.Kernel:
    """The kernel that bounds each primitive of the family `name` over each block's sphere."""
    module = f"resfit.kernels.field.culling.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    entry = family(name)
    sdf, reach, table = entry.sdf, entry.reach, entry.table

    @wp.kernel(module=module)
    def bound_primitives_kernel(
        first: int,
        primitives: Primitives,
        tables: wp.array[table],
        points: Points,
        radius: wp.array[float],
        group_count: int,
        # outputs
        out_middle: wp.array[float],
        out_reach: wp.array[float],
    ):
        t = first + wp.tid()
        k = primitives.begin + t / group_count
        base = (t - (t / group_count) * group_count) * BLOCK_C
        store = k * group_count * BLOCK_C + base
        f = primitives.frames[k]
        s = tables[k]
        for j in range(BLOCK_C):
            px, py, pz = local_point(points, base + j, f)
            out_middle[store + j] = sdf(s, px, py, pz)
            out_reach[store + j] = reach(s, px, py, pz, radius[base + j])

    return bound_primitives_kernel


@wp.kernel
def cull_blocks_kernel(
    first: int,
    rows: wp.array[float],
    middle: wp.array[float],
    reach: wp.array[float],
    primitive_count: int,
    stride: int,
    wanted: wp.array[int],
    # outputs
    out_ids: wp.array[int],
    out_counts: wp.array[int],
):
    """Fold the bounds of one block and list the primitives that can change its values.

    A block that is not `wanted` is only asked for its sign: outside the union it needs none.
    """
    block = first + wp.tid()
    low = float(FAR)
    high = float(FAR)
    count = int(0)
    base = block * primitive_count
    for k in range(primitive_count):
        gate = rows[k * ROW_C + GATE_C]
        blend = rows[k * ROW_C + BLEND_C]
        at = gate * middle[k * stride + block] + 1.0 - gate
        spread = gate * reach[k * stride + block] + MARGIN
        if at - spread < high + blend:
            if low >= at + spread + blend:
                count = 0
            out_ids[base + count] = k
            count += 1
            quarter = quarter_inverse(blend)
            low = smooth_minimum(low, at - spread, blend, quarter)
            high = smooth_minimum(high, at + spread, blend, quarter)
    out_counts[block] = wp.where(wanted[block] == 0, wp.where(low > 0.0, 0, count), count)


@dataclass(frozen=True)
class BlockBounds:
    """Bounding spheres of blocks, padded to whole groups of BLOCK blocks (padding has radius 0 at the origin)."""

    x: wp.array
    y: wp.array
    z: wp.array
    radius: wp.array

    @cached_property
    def points(self) -> Any:
        """The centres as one argument of a kernel: a `Points`."""
        return points_argument(self.x, self.y, self.z)


def bound_blocks(blocks: PointBlocks) -> BlockBounds:
    """Bounding spheres of all blocks: computed once for points that are evaluated often."""
    size = padded_count(blocks.block_count)
    arrays = [wp.zeros(size, dtype=float, device=blocks.device) for _ in range(4)]
    launch(
        bound_blocks_kernel,
        blocks.block_count,
        [blocks.x, blocks.y, blocks.z],
        arrays,
        blocks.device,
        seconds_per_thread=2e-7,
    )
    return BlockBounds(*arrays)


def bound_primitives(
    primitives: PrimitiveSet, bounds: BlockBounds, out: tuple[wp.array, wp.array] | None = None
) -> tuple[wp.array, wp.array]:
    """Values of each primitive in the middle of each block, and bounds on their change within it.

    Returns:
        Both (primitive_count * padded block count,), primitive-major; `out` where it is given.
    """
    size, device = bounds.x.shape[0], primitives.device
    middle, reach = out or (wp.empty(len(primitives) * size, dtype=float, device=device) for _ in range(2))
    launch_pairs(
        bound_kernel,
        primitives,
        size // BLOCK,
        [bounds.points, bounds.radius, size // BLOCK],
        [middle, reach],
        3e-7,
    )
    return middle, reach


def cull(
    primitives: PrimitiveSet,
    blocks: PointBlocks,
    bounds: BlockBounds | None = None,
    wanted: wp.array | None = None,
) -> ActiveLists:
    """Active lists of every block. Exact: the union over them has the same values as over all primitives.

    Args:
        primitives: the assembly.
        blocks: the points.
        bounds: of the blocks, if they are known.
        wanted: (block_count,) int32, 0 where a block's values do not matter as long as they are positive outside the
            union: there it may come out as FAR. All blocks matter unless given.
    """
    device = blocks.device
    if wanted is None:
        wanted = wp.full(max(1, blocks.block_count), 1, dtype=int, device=device)
    middle, reach = bound_primitives(primitives, bounds or bound_blocks(blocks))
    ids = wp.empty(max(1, blocks.block_count * len(primitives)), dtype=int, device=device)
    counts = wp.empty(max(1, blocks.block_count), dtype=int, device=device)
    launch(
        cull_blocks_kernel,
        blocks.block_count,
        [primitives.rows, middle, reach, len(primitives), padded_count(blocks.block_count), wanted],
        [ids, counts],
        device,
        seconds_per_thread=5e-9 * len(primitives),
    )
    return ActiveLists(ids, counts)


def every_primitive(primitives: PrimitiveSet, blocks: PointBlocks) -> ActiveLists:
    """Lists that leave nothing out: dense evaluation."""
    ids = np.tile(np.arange(len(primitives), dtype=np.int32), blocks.block_count)
    counts = np.full(blocks.block_count, len(primitives), np.int32)
    return ActiveLists(
        wp.array(ids, dtype=int, device=blocks.device), wp.array(counts, dtype=int, device=blocks.device)
    )


DENSE_UP_TO = 3
"""Culling costs about one evaluation in 30; with this few primitives it gains nothing."""


def active_lists(
    primitives: PrimitiveSet, blocks: PointBlocks, bounds: BlockBounds | None = None
) -> ActiveLists:
    """Culled lists, or dense ones where there are too few primitives to be worth it."""
    if len(primitives) <= DENSE_UP_TO:
        return every_primitive(primitives, blocks)
    return cull(primitives, blocks, bounds)
