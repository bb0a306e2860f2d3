"""The field of primitives and of their union, at points and on grids."""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

import numpy as np
import warp as wp

from ..primitives import family
from ..rows import BLEND_C, GATE_C, ROW_C
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import VECTOR_OPTIONS
from .block import BlockFloats, block_functions, launch_pairs, launch_runs
from .combine import FAR, gated, quarter_inverse, smooth_minimum
from .culling import ActiveLists, BlockBounds, Lists, active_lists
from .points import BLOCK_C, PointBlocks, Points, from_grid_blocks, grid_blocks, point_blocks
from .primitive_set import Primitives, PrimitiveSet

BLOCK_SECONDS = 1.2e-7
"""One primitive over one block of points, forward, on one core: decides when a launch is split."""


@cached_kernel
def field_kernels(name: str) -> tuple[wp.Kernel, wp.Kernel]:
    """Kernels of the family `name`: each primitive alone, and the union folded on over a run of primitives."""
    module = f"resfit.kernels.field.evaluate.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    table = family(name).table
    block_distances = block_functions(name).distances

    @wp.kernel(module=module)
    def evaluate_primitives_kernel(
        first: int,
        primitives: Primitives,
        tables: wp.array[table],
        points: Points,
        block_count: int,
        # outputs
        out_values: wp.array[float],
    ):
        t = first + wp.tid()
        n = t / block_count
        k = primitives.begin + n
        base = (t - n * block_count) * BLOCK_C
        distance = BlockFloats()
        block_distances(points, base, primitives.frames[k], tables[k], distance)
        store = k * block_count * BLOCK_C + base
        for j in range(BLOCK_C):
            out_values[store + j] = distance[j]

    @wp.kernel(module=module)
    def fold_union_kernel(
        first: int,
        primitives: Primitives,
        tables: wp.array[table],
        points: Points,
        lists: Lists,
        # outputs
        out_field: wp.array[float],
    ):
        block = first + wp.tid()
        base = block * BLOCK_C
        distance = BlockFloats()
        if primitives.begin == 0:
            for j in range(BLOCK_C):
                out_field[base + j] = FAR
        for n in range(lists.counts[block]):
            k = lists.ids[block * primitives.count + n]
            if k >= primitives.begin and k < primitives.end:
                block_distances(points, base, primitives.frames[k], tables[k], distance)
                blend = primitives.rows[k * ROW_C + BLEND_C]
                gate = primitives.rows[k * ROW_C + GATE_C]
                quarter = quarter_inverse(blend)
                for j in range(BLOCK_C):
                    value = gated(distance[j], gate)
                    out_field[base + j] = smooth_minimum(out_field[base + j], value, blend, quarter)

    return evaluate_primitives_kernel, fold_union_kernel


def primitives_at(
    primitives: PrimitiveSet, blocks: PointBlocks, out_values: wp.array | None = None
) -> wp.array:
    """Every primitive alone, ungated, at every point: (primitive_count * padded points,) primitive-major."""
    size = blocks.x.shape[0]
    if out_values is None:
        out_values = wp.empty(max(1, len(primitives) * size), dtype=float, device=blocks.device)
    launch_pairs(
        lambda name: field_kernels(name)[0],
        primitives,
        blocks.block_count,
        [blocks.points, blocks.block_count],
        [out_values],
        BLOCK_SECONDS,
    )
    return out_values


def union_at(
    primitives: PrimitiveSet,
    blocks: PointBlocks,
    bounds: BlockBounds | None = None,
    lists: ActiveLists | None = None,
    out_field: wp.array | None = None,
) -> wp.array:
    """The smooth union at every point, (padded points,); FAR where there is no primitive.

    `lists` names the primitives of each block; without it they are culled, given few primitives left dense. `bounds`
    saves their recomputation for points that are evaluated often.
    """
    if out_field is None:
        out_field = wp.empty(max(1, blocks.x.shape[0]), dtype=float, device=blocks.device)
    if not len(primitives):
        out_field.fill_(FAR)
        return out_field
    lists = lists or active_lists(primitives, blocks, bounds)
    launch_runs(
        lambda name: field_kernels(name)[1],
        primitives,
        blocks.block_count,
        [blocks.points, lists.argument],
        [out_field],
        0.3 * BLOCK_SECONDS,
    )
    return out_field


def evaluate_primitives(primitives: PrimitiveSet, points: np.ndarray) -> np.ndarray:
    """Signed distance of each primitive alone, ungated.

    Args:
        primitives: the assembly.
        points: (n, 3), normalised frame.

    Returns:
        (primitive_count, n) float32, normalised units, negative inside.
    """
    if not len(points) or not len(primitives):
        return np.zeros((len(primitives), len(points)), np.float32)
    blocks = point_blocks(points, primitives.device)
    return primitives_at(primitives, blocks).numpy().reshape(len(primitives), -1)[:, : blocks.count]


def evaluate_assembly(primitives: PrimitiveSet, points: np.ndarray) -> np.ndarray:
    """Signed distance of the smooth union.

    Args:
        primitives: the assembly.
        points: (n, 3), normalised frame; faster if neighbours in the list are neighbours in space.

    Returns:
        (n,) float32, normalised units, negative inside; 1e30 where the assembly is empty.
    """
    if not len(points):
        return np.zeros(0, np.float32)
    blocks = point_blocks(points, primitives.device)
    return union_at(primitives, blocks).numpy()[: blocks.count]


def evaluate_grid(
    primitives: PrimitiveSet,
    shape: tuple[int, int, int],
    lower: tuple[float, float, float],
    spacing: float,
) -> np.ndarray:
    """The smooth union at the points lower + spacing * (i, j, k), normalised frame, as a float32 array of `shape`."""
    blocks = grid_blocks(shape, lower, spacing, primitives.device)
    return from_grid_blocks(union_at(primitives, blocks).numpy(), shape)


def cell_centres(resolution: int) -> tuple[tuple[int, int, int], tuple[float, float, float], float]:
    """Shape, lower corner and spacing of the resolution^3 cell centres of [-1, 1]^3, for `evaluate_grid`."""
    spacing = 2.0 / resolution
    lower = -1.0 + 0.5 * spacing
    return (resolution, resolution, resolution), (lower, lower, lower), spacing
