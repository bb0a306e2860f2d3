"""Point containment in primitives, as bit masks: for many small primitives at the same points.

Most points are far from a small primitive: they are kept in blocks of neighbours, and a block that lies wholly outside
a primitive, or wholly inside, is settled by its bounding sphere.
"""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

import numpy as np
import warp as wp

from ..field.block import BlockFloats, block_functions, launch_pairs
from ..field.culling import MARGIN, bound_blocks, bound_primitives
from ..field.hilbert import curve_codes
from ..field.points import BLOCK, BLOCK_C, Points, padded_count, point_blocks
from ..field.primitive_set import Primitives, PrimitiveSet
from ..primitives import family
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import VECTOR_OPTIONS, launch
from .coverage_sets import WORD, WORD_C

wp.set_module_options(VECTOR_OPTIONS)

BLOCK_WORDS_C = wp.constant(BLOCK // WORD)


@cached_kernel
def mask_kernel(name: str) -> wp.Kernel:
    """The kernel that says which points of each block a primitive of the family `name` holds."""
    module = f"resfit.kernels.select.containment.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    table = family(name).table
    block_distances = block_functions(name).distances

    @wp.kernel(module=module)
    def mask_points_kernel(
        first: int,
        primitives: Primitives,
        tables: wp.array[table],
        points: Points,
        block_count: int,
        middle: wp.array[float],
        reach: wp.array[float],
        stride: int,
        # outputs
        out_masks: wp.array[wp.uint32],
    ):
        """One block and primitive; `middle` and `reach`, `stride` a primitive, bound it in the block."""
        t = first + wp.tid()
        k = primitives.begin + t / block_count
        block = t - (k - primitives.begin) * block_count
        bound = k * stride + block
        store = (k * block_count + block) * BLOCK_WORDS_C
        settled = middle[bound] + reach[bound] + MARGIN < 0.0
        if settled or middle[bound] - reach[bound] - MARGIN > 0.0:
            for word in range(BLOCK_WORDS_C):
                out_masks[store + word] = wp.where(settled, ~wp.uint32(0), wp.uint32(0))
        else:
            distance = BlockFloats()
            block_distances(points, block * BLOCK_C, primitives.frames[k], tables[k], distance)
            for word in range(BLOCK_WORDS_C):
                held = wp.uint32(0)
                for j in range(WORD_C):
                    bit = wp.uint32(1) << wp.uint32(j)
                    held = held | wp.where(distance[word * WORD_C + j] < 0.0, bit, wp.uint32(0))
                out_masks[store + word] = held

    return mask_points_kernel


@wp.kernel
def reorder_masks_kernel(
    first: int,
    masks: wp.array[wp.uint32],
    word_count: int,
    order: wp.array[int],
    point_count: int,
    out_word_count: int,
    # outputs
    out_masks: wp.array[wp.uint32],
):
    """Bring one primitive's mask into the order of the points; bits beyond `point_count` are padding."""
    k = first + wp.tid()
    row = k * out_word_count
    for word in range(out_word_count):
        out_masks[row + word] = wp.uint32(0)
    for word in range(word_count):
        left = masks[k * word_count + word]
        while left != wp.uint32(0):
            others = left & (left - wp.uint32(1))
            place = word * WORD_C + int(wp.bit_count((left ^ others) - wp.uint32(1)))
            if place < point_count:
                point = order[place]
                at = row + point / WORD_C
                bit = wp.uint32(1) << wp.uint32(point - (point / WORD_C) * WORD_C)
                out_masks[at] = out_masks[at] | bit
            left = others


class PointContainment:
    """Points, asked again and again which of them primitives hold."""

    def __init__(self, points: np.ndarray, device: wp.Device):
        """`points` (n, 3), normalised frame."""
        order = np.argsort(curve_codes(points), kind="stable")
        self.blocks = point_blocks(points[order], device)
        self.bounds = bound_blocks(self.blocks)
        self.order = wp.array(order.astype(np.int32), dtype=int, device=device)

    def masks(self, primitives: PrimitiveSet) -> np.ndarray:
        """Bit masks of the points in each primitive, a bit a point: (primitive_count, words) uint32."""
        blocks, count, device = self.blocks, len(primitives), primitives.device
        words, block_words = -(-blocks.count // WORD), blocks.block_count * (BLOCK // WORD)
        if not count:
            return np.zeros((0, words), np.uint32)
        middle, reach = bound_primitives(primitives, self.bounds)
        along_curve = wp.empty(count * block_words, dtype=wp.uint32, device=device)
        launch_pairs(
            mask_kernel,
            primitives,
            blocks.block_count,
            [blocks.points, blocks.block_count, middle, reach, padded_count(blocks.block_count)],
            [along_curve],
            2e-8,
        )
        masks = wp.empty(count * words, dtype=wp.uint32, device=device)
        launch(
            reorder_masks_kernel,
            count,
            [along_curve, block_words, self.order, blocks.count, words],
            [masks],
            device,
            seconds_per_thread=1e-5,
        )
        return masks.numpy().reshape(count, words)
