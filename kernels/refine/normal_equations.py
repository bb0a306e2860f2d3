"""Levenberg-Marquardt normal equations of many primitives at once, each over the points that belong to it.

Residual of a point with target distance d and weight w: w (sigmoid(-beta F) - sigmoid(-beta d)), where F = f + offset
is the union at the point and f its own primitive's distance; its row is the derivative through f alone, times `slope`
= dF/df. With offset 0 and slope 1 the primitive stands alone. A block of points has one owner, so that one thread makes
its rows and sums their products: no row leaves the core, no atomic is needed, the order is fixed.
Primitives may share points: many starts of one region read the same blocks.
"""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

from collections.abc import Callable

import numpy as np
import warp as wp

from ..field.block import block_functions, launch_runs, local_point
from ..field.jacobian import TANGENT_C, jacobian_row
from ..field.points import Points, at
from ..field.primitive_set import Primitives, PrimitiveSet
from ..primitives import family
from ..rows import DERIVATIVES_C, Derivatives
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import PLAIN_OPTIONS, VECTOR_OPTIONS, launch
from ..vector_math import clamp_symmetric
from .block_solve import BLEND_UNKNOWN, RESIDUAL_C, SYSTEM_C
from .block_solve import SYSTEM as SYSTEM
from .point_batches import OWNER_BLOCK, OWNER_BLOCK_C, PointBatches, Wanted
from .soft_occupancy import soft_occupancy

BLOCK_SECONDS = 2.5e-6
"""One block of one owner, on one core."""

SystemRow = wp.types.vector(length=SYSTEM, dtype=float)

TILE = wp.constant(4)
"""Rows and columns of a system that are summed at a time: as many sums as fit in a core's vector registers."""
Tile = wp.types.matrix(shape=(4, 4), dtype=float)

ENTRIES = 64
ENTRIES_C = wp.constant(ENTRIES)
"""Entries of a system that a thread adds up."""

GPU_CHUNK = 32
"""Points whose Jacobian rows a thread holds at a time on a GPU, where its fast memory is small."""

STEEPEST = wp.constant(16.0)
"""Derivatives are clipped to this: a few are unbounded, as at an arc's centre (superfrustum.md, "Derivatives"), and one
such point would rule a whole system."""

ADD = "resfit.kernels.refine.normal_equations.add"
wp.set_module_options(PLAIN_OPTIONS, module=ADD)


@wp.func
def system_row(
    x: float,
    y: float,
    z: float,
    d: Derivatives,
    wanted: Wanted,
    i: int,
    beta: float,
) -> SystemRow:
    """The weighted Jacobian row and residual of point `i`, which is (x, y, z) locally, steep entries clipped."""
    weight = at(wanted.weight, i)
    occupied = soft_occupancy(d[0] + at(wanted.offset, i), beta)
    steep = -weight * beta * occupied * (1.0 - occupied)
    scale = at(wanted.slope, i) * steep
    c = d
    for m in range(1, DERIVATIVES_C):
        c[m] = clamp_symmetric(d[m], STEEPEST)
    row = jacobian_row(x, y, z, c)
    out = SystemRow()
    for m in range(TANGENT_C):
        out[m] = scale * row[m]
    out[BLEND_UNKNOWN] = steep * at(wanted.widening, i)
    out[RESIDUAL_C] = weight * (occupied - soft_occupancy(at(wanted.target, i), beta))
    return out


@cached_kernel
def normal_equations_kernel(name: str, chunk: int) -> wp.Kernel:
    """The kernel of the family `name`: the sums of all products of the rows of a block of points.

    A thread writes `chunk` rows into a local matrix and then sums products a tile at a time.
    """
    module = f"resfit.kernels.refine.normal_equations.{name}.{chunk}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    table = family(name).table
    # Rows take the place of the derivatives that they are made of.
    block_derivatives = block_functions(name, chunk, SYSTEM).derivatives
    chunk_c, chunk_count = wp.constant(chunk), OWNER_BLOCK // chunk
    row_matrix = wp.types.matrix(shape=(SYSTEM, chunk), dtype=float)

    @wp.kernel(module=module)
    def sum_normal_equations_kernel(
        first: int,
        primitives: Primitives,
        tables: wp.array[table],
        points: Points,
        wanted: Wanted,
        owners: wp.array[int],
        point_blocks: wp.array[int],
        betas: wp.array[float],
        # outputs
        out_systems: wp.array[float],
    ):
        pair = first + wp.tid()
        k = owners[pair]
        if k < primitives.begin or k >= primitives.end:
            return
        beta = betas[k]
        f = primitives.frames[k]
        store = pair * SYSTEM_C * SYSTEM_C
        for m in range(SYSTEM_C * SYSTEM_C):
            out_systems[store + m] = 0.0
        # Bounds that are known at run time only keep the loops over chunks and tiles loops.
        chunks = int(wp.static(chunk_count))
        size = int(SYSTEM_C)
        for number in range(chunks):
            base = point_blocks[pair] * OWNER_BLOCK_C + number * chunk_c
            rows = row_matrix()
            block_derivatives(points, base, f, tables[k], rows)
            for j in range(chunk_c):
                px, py, pz = local_point(points, base + j, f)
                d = Derivatives()
                for m in range(DERIVATIVES_C):
                    d[m] = rows[m, j]
                row = system_row(px, py, pz, d, wanted, base + j, beta)
                for a in range(SYSTEM_C):
                    rows[a, j] = row[a]
            for top in range(0, size, TILE):
                for left in range(top, size, TILE):
                    products = Tile()
                    for j in range(chunk_c):
                        for a in range(TILE):
                            for b in range(TILE):
                                products[a, b] += rows[top + a, j] * rows[left + b, j]
                    for a in range(TILE):
                        for b in range(TILE):
                            out_systems[store + (top + a) * SYSTEM_C + left + b] += products[a, b]

    return sum_normal_equations_kernel


def kernel_on(device: wp.Device, name: str) -> wp.Kernel:
    """The kernel of the family `name` for a device: on the CPU a block's rows, all at once, stay in the cache."""
    return normal_equations_kernel(name, OWNER_BLOCK if device.is_cpu else GPU_CHUNK)


@wp.kernel(module=ADD)
def add_systems_kernel(
    first: int,
    systems: wp.array[float],
    first_block: wp.array[int],
    # outputs
    out_systems: wp.array[float],
):
    """Add some entries of one primitive's system over its blocks, in order."""
    t = first + wp.tid()
    k = t / (SYSTEM_C * SYSTEM_C / ENTRIES_C)
    part = t * ENTRIES_C
    for j in range(ENTRIES_C):
        out_systems[part + j] = 0.0
    for block in range(first_block[k], first_block[k + 1]):
        here = part + (block - k) * SYSTEM_C * SYSTEM_C
        for j in range(ENTRIES_C):
            out_systems[part + j] += systems[here + j]


def partial_systems(points: PointBatches, device: wp.Device) -> wp.array:
    """Scratch of `normal_equations_at`."""
    return wp.empty(max(1, points.pair_count * SYSTEM * SYSTEM), dtype=float, device=device)


def normal_equations_at(
    primitives: PrimitiveSet,
    points: PointBatches,
    betas: wp.array,
    out_partial: wp.array,
    out_systems: wp.array,
    pair_count: int | Callable[[], int] | None = None,
) -> None:
    """Fill the upper triangles of `out_systems` (primitive_count * SYSTEM^2,).

    `out_partial` (pair_count * SYSTEM^2,) is scratch. `pair_count` says how many pairs are in use where it is
    not all of them.
    """
    device = primitives.device
    if len(primitives):
        launch_runs(
            lambda name: kernel_on(device, name),
            primitives,
            points.pair_count if pair_count is None else pair_count,
            [points.points, points.wanted, points.owners, points.point_blocks, betas],
            [out_partial],
            BLOCK_SECONDS / len(primitives),
        )
    launch(
        add_systems_kernel,
        len(primitives) * SYSTEM * SYSTEM // ENTRIES,
        [out_partial, points.first_block],
        [out_systems],
        device,
        seconds_per_thread=5e-9 * points.pair_count / max(1, len(primitives)),
    )


def normal_equations(primitives: PrimitiveSet, points: PointBatches, beta: float | np.ndarray) -> np.ndarray:
    """One system a primitive: sums over its points of the products of (Jacobian row, residual) with itself.

    Args:
        primitives: the assembly.
        points: its points by owner.
        beta: sharpness of the occupancy per normalised unit, one for all or (primitive_count,).

    Returns:
        (primitive_count, SYSTEM, SYSTEM) float32, symmetric: J^T J of the UNKNOWNS first, J^T r in
        the last column, r^T r in the corner.
    """
    device, count = primitives.device, len(primitives)
    partial = partial_systems(points, device)
    systems = wp.zeros(max(1, count * SYSTEM * SYSTEM), dtype=float, device=device)
    if count:
        betas = wp.array(np.broadcast_to(np.float32(beta), count).copy(), dtype=float, device=device)
        normal_equations_at(primitives, points, betas, partial, systems)
    upper = np.triu(systems.numpy()[: count * SYSTEM * SYSTEM].reshape(-1, SYSTEM, SYSTEM))
    return upper + np.triu(upper, 1).transpose(0, 2, 1)
