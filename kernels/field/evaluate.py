"""The field of primitives and of their union, at points and on grids."""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

import numpy as np
import warp as wp

from ..primitives import family
from ..rows import BLEND_C, GATE_C, ROW_C
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import VECTOR_OPTIONS, launch
from ..vector_math import larger
from .combine import FAR, gated, quarter_inverse, smooth_minimum
from .culling import ActiveLists, BlockBounds, active_lists
from .frame import Frame, to_local
from .points import BLOCK_C, PointBlocks, from_grid_blocks, grid_blocks, point_blocks
from .primitive_set import PrimitiveSet

BLOCK_SECONDS = 1.2e-7
"""One primitive over one block of points, forward, on one core: decides when a launch is split."""


@cached_kernel
def field_kernels(name: str) -> tuple[wp.Kernel, wp.Kernel]:
    """Kernels of the family `name`: each primitive alone, and the union folded on over a run of primitives.

    A block whose points all lie outside the slow zone takes the cheaper form of the field.
    """
    module = f"resfit.kernels.field.evaluate.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    entry = family(name)
    table = entry.table
    sdf = entry.sdf
    fast = entry.fast or entry.sdf
    has_seam_zone = entry.seam_zone is not None
    seam_zone = entry.seam_zone or entry.sdf

    @wp.kernel(module=module)
    def evaluate_primitives_kernel(
        first: int,
        x: wp.array[float],
        y: wp.array[float],
        z: wp.array[float],
        frames: wp.array[Frame],
        tables: wp.array[table],
        begin: int,
        block_count: int,
        # outputs
        out_values: wp.array[float],
    ):
        t = first + wp.tid()
        k = t / block_count
        base = (t - k * block_count) * BLOCK_C
        store = (begin + k) * block_count * BLOCK_C + base
        f = frames[begin + k]
        s = tables[begin + k]
        slow = float(0.0)
        if wp.static(has_seam_zone):
            for j in range(BLOCK_C):
                px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                slow += larger(seam_zone(s, px, py, pz), 0.0)
        if slow > 0.0:
            for j in range(BLOCK_C):
                px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                out_values[store + j] = sdf(s, px, py, pz)
        else:
            for j in range(BLOCK_C):
                px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                out_values[store + j] = fast(s, px, py, pz)

    @wp.kernel(module=module)
    def fold_union_kernel(
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
    ):
        block = first + wp.tid()
        base = block * BLOCK_C
        if run[0] == 0:
            for j in range(BLOCK_C):
                out_field[base + j] = FAR
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
                        value = gated(sdf(s, px, py, pz), gate)
                        out_field[base + j] = smooth_minimum(out_field[base + j], value, blend, quarter)
                else:
                    for j in range(BLOCK_C):
                        px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                        value = gated(fast(s, px, py, pz), gate)
                        out_field[base + j] = smooth_minimum(out_field[base + j], value, blend, quarter)

    return evaluate_primitives_kernel, fold_union_kernel


def primitives_at(
    primitives: PrimitiveSet, blocks: PointBlocks, out_values: wp.array | None = None
) -> wp.array:
    """Every primitive alone, ungated, at every point: (primitive_count * padded points,) primitive-major."""
    size = blocks.x.shape[0]
    if out_values is None:
        out_values = wp.empty(max(1, len(primitives) * size), dtype=float, device=blocks.device)
    for run in primitives.runs:
        launch(
            field_kernels(run.family.name)[0],
            run.count * blocks.block_count,
            [
                blocks.x,
                blocks.y,
                blocks.z,
                primitives.frames,
                primitives.tables[run.family.name],
                run.begin,
                blocks.block_count,
            ],
            [out_values],
            blocks.device,
            seconds_per_thread=BLOCK_SECONDS,
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
    for run in primitives.runs:
        launch(
            field_kernels(run.family.name)[1],
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
            [out_field],
            blocks.device,
            seconds_per_thread=0.3 * BLOCK_SECONDS * run.count,
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
