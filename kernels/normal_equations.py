"""Levenberg-Marquardt normal equations of many primitives at once, each over the points that belong to it.

Residual of a point with target occupancy o and weight w: w (sigmoid(-beta F) - o), where F = f + offset is the
union at the point and f its own primitive's distance; its row is the derivative through f alone, times `slope` =
dF/df. With offset 0 and slope 1 the primitive stands alone. A block of points has one owner, so that a thread sums
value, gradient, residual and all products in registers: no row is stored, no atomic is needed, the order is fixed.
"""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

from dataclasses import dataclass
from functools import cache

import numpy as np
import warp as wp

from .frame import Frame, to_local
from .jacobian import TANGENT_C, jacobian_row
from .launch import PLAIN_OPTIONS, VECTOR_OPTIONS, launch
from .loss import occupancy
from .primitive_set import PrimitiveSet
from .primitives import family
from .rows import TANGENT, Derivatives
from .vector_math import clamp_symmetric, larger

OWNER_BLOCK = 256
"""Points of one owner a thread sums over. Longer blocks vectorise better, shorter ones need less padding."""
OWNER_BLOCK_C = wp.constant(OWNER_BLOCK)
BLOCK_SECONDS = 2.5e-6
"""One block of one owner, on one core."""

SYSTEM = TANGENT + 1
"""Columns of a system: the Jacobian's, then the residual."""
SYSTEM_C = wp.constant(SYSTEM)
System = wp.types.matrix(shape=(SYSTEM, SYSTEM), dtype=float)
SystemRow = wp.types.vector(length=SYSTEM, dtype=float)

STEEPEST = wp.constant(16.0)
"""Derivatives to position, height and bulge are clipped to this: at an arc's centre they are unbounded (spec section
9), and one such point would rule a whole system."""

ADD = "resfit.kernels.normal_equations.add"
wp.set_module_options(PLAIN_OPTIONS, module=ADD)


@dataclass(frozen=True)
class OwnedPoints:
    """Points sorted by the primitive they belong to, in blocks of OWNER_BLOCK with one owner each.

    All arrays but `owners` and `first_block` are (block_count * OWNER_BLOCK,) float32; padding has weight 0.
    """

    x: wp.array
    y: wp.array
    z: wp.array
    target: wp.array
    """Occupancy in [0, 1] that the union should have."""
    weight: wp.array
    """Square root of the point's weight in the loss."""
    offset: wp.array
    """Union minus the owner's own distance."""
    slope: wp.array
    """Derivative of the union to the owner's own distance."""
    owners: wp.array
    """(block_count,) int32, ascending."""
    first_block: wp.array
    """(primitive_count + 1,) int32: blocks first_block[k] .. first_block[k + 1] - 1 belong to primitive k."""
    order: np.ndarray
    """(block_count * OWNER_BLOCK,): which of the given points stands where; -1 in the padding."""

    @property
    def block_count(self) -> int:
        """Number of blocks."""
        return self.owners.shape[0] if self.order.size else 0


def owned_points(
    points: np.ndarray,
    owners: np.ndarray,
    primitive_count: int,
    target: np.ndarray,
    weight: np.ndarray | None = None,
    offset: np.ndarray | None = None,
    slope: np.ndarray | None = None,
    device: wp.Device | None = None,
) -> OwnedPoints:
    """Sort points by owner into padded blocks.

    Args:
        points: (n, 3), normalised frame. A point that belongs to two primitives is given twice.
        owners: (n,) in 0 .. primitive_count - 1.
        primitive_count: number of primitives; some may own nothing.
        target: (n,) occupancy.
        weight: (n,) square roots of weights, 1 by default.
        offset, slope: (n,), 0 and 1 by default.
        device: where the arrays go, the CPU by default.
    """
    owners = np.asarray(owners, np.int64)
    counts = np.bincount(owners, minlength=primitive_count)
    blocks = -(-counts // OWNER_BLOCK)
    first_block = np.concatenate([[0], np.cumsum(blocks)])
    sorted_points = np.argsort(owners, kind="stable")
    begin = np.concatenate([[0], np.cumsum(counts)[:-1]])
    place = first_block[:-1][owners[sorted_points]] * OWNER_BLOCK
    place += np.arange(len(owners)) - begin[owners[sorted_points]]
    order = np.full(first_block[-1] * OWNER_BLOCK, -1, np.int64)
    order[place] = sorted_points

    def gather(values: np.ndarray | None, default: float) -> wp.array:
        packed = np.zeros(max(1, len(order)), np.float32)
        packed[place] = default if values is None else np.asarray(values, np.float32)[sorted_points]
        return wp.array(packed, dtype=float, device=device)

    points = np.asarray(points, np.float32).reshape(-1, 3)
    block_owners = np.repeat(np.arange(primitive_count), blocks)
    return OwnedPoints(
        *(gather(points[:, axis], 0.0) for axis in range(3)),
        target=gather(target, 0.0),
        weight=gather(weight, 1.0),
        offset=gather(offset, 0.0),
        slope=gather(slope, 1.0),
        owners=wp.array(
            block_owners.astype(np.int32) if len(block_owners) else np.zeros(1, np.int32),
            dtype=int,
            device=device,
        ),
        first_block=wp.array(first_block.astype(np.int32), dtype=int, device=device),
        order=order,
    )


@wp.func
def system_row(
    x: float,
    y: float,
    z: float,
    d: Derivatives,
    target: float,
    weight: float,
    offset: float,
    slope: float,
    beta: float,
) -> SystemRow:
    """The weighted Jacobian row and residual of a local point (x, y, z), steep entries clipped."""
    occupied = occupancy(d[0] + offset, beta)
    scale = -weight * slope * beta * occupied * (1.0 - occupied)
    c = d
    c[1] = clamp_symmetric(d[1], STEEPEST)
    c[3] = clamp_symmetric(d[3], STEEPEST)
    c[6] = clamp_symmetric(d[6], STEEPEST)
    c[10] = clamp_symmetric(d[10], STEEPEST)
    row = jacobian_row(x, y, z, c)
    out = SystemRow()
    for m in range(TANGENT_C):
        out[m] = scale * row[m]
    out[TANGENT_C] = weight * (occupied - target)
    return out


@cache
def normal_equations_kernel(name: str) -> wp.Kernel:
    """The kernel of the family `name`: value, gradient, residual and the sums of all their products over a block."""
    module = f"resfit.kernels.normal_equations.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    entry = family(name)
    table = entry.table
    sdf_grad = entry.sdf_grad
    fast_grad = entry.fast_grad or entry.sdf_grad
    has_slow_zone = entry.slow_zone is not None
    slow_zone = entry.slow_zone or entry.sdf

    @wp.kernel(module=module)
    def sum_normal_equations_kernel(
        first: int,
        x: wp.array[float],
        y: wp.array[float],
        z: wp.array[float],
        target: wp.array[float],
        weight: wp.array[float],
        offset: wp.array[float],
        slope: wp.array[float],
        owners: wp.array[int],
        frames: wp.array[Frame],
        tables: wp.array[table],
        run: wp.vec2i,
        beta: float,
        # outputs
        out_systems: wp.array[float],
    ):
        block = first + wp.tid()
        k = owners[block]
        if k >= run[0] and k < run[1]:
            base = block * OWNER_BLOCK_C
            f = frames[k]
            s = tables[k]
            total = System()
            slow = float(-1.0)
            if wp.static(has_slow_zone):
                for j in range(OWNER_BLOCK_C):
                    px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                    slow = larger(slow, slow_zone(s, px, py, pz))
            if slow > 0.0:
                for j in range(OWNER_BLOCK_C):
                    i = base + j
                    px, py, pz = to_local(f, x[i], y[i], z[i])
                    d = sdf_grad(s, px, py, pz)
                    row = system_row(px, py, pz, d, target[i], weight[i], offset[i], slope[i], beta)
                    for a in range(SYSTEM_C):
                        for b in range(a, SYSTEM_C):
                            total[a, b] += row[a] * row[b]
            else:
                for j in range(OWNER_BLOCK_C):
                    i = base + j
                    px, py, pz = to_local(f, x[i], y[i], z[i])
                    d = fast_grad(s, px, py, pz)
                    row = system_row(px, py, pz, d, target[i], weight[i], offset[i], slope[i], beta)
                    for a in range(SYSTEM_C):
                        for b in range(a, SYSTEM_C):
                            total[a, b] += row[a] * row[b]
            for a in range(SYSTEM_C):
                for b in range(a, SYSTEM_C):
                    out_systems[(block * SYSTEM_C + a) * SYSTEM_C + b] = total[a, b]

    return sum_normal_equations_kernel


@wp.kernel(module=ADD)
def add_systems_kernel(
    first: int,
    systems: wp.array[float],
    first_block: wp.array[int],
    # outputs
    out_systems: wp.array[float],
):
    """Add one entry of one primitive's system over its blocks, in order, and mirror it."""
    t = first + wp.tid()
    k = t / (SYSTEM_C * SYSTEM_C)
    entry = t - k * SYSTEM_C * SYSTEM_C
    a = entry / SYSTEM_C
    b = entry - a * SYSTEM_C
    if a <= b:
        total = float(0.0)
        for block in range(first_block[k], first_block[k + 1]):
            total += systems[block * SYSTEM_C * SYSTEM_C + entry]
        out_systems[t] = total
        out_systems[(k * SYSTEM_C + b) * SYSTEM_C + a] = total


def normal_equations_at(
    primitives: PrimitiveSet, points: OwnedPoints, beta: float, out_partial: wp.array, out_systems: wp.array
) -> None:
    """Fill `out_systems` (primitive_count * SYSTEM^2,); `out_partial` (block_count * SYSTEM^2,) is scratch."""
    device = primitives.device
    for run in primitives.runs:
        launch(
            normal_equations_kernel(run.family.name),
            points.block_count,
            [
                points.x,
                points.y,
                points.z,
                points.target,
                points.weight,
                points.offset,
                points.slope,
                points.owners,
                primitives.frames,
                primitives.tables[run.family.name],
                wp.vec2i(run.begin, run.end),
                float(beta),
            ],
            [out_partial],
            device,
            seconds_per_thread=BLOCK_SECONDS * run.count / len(primitives),
        )
    launch(
        add_systems_kernel,
        len(primitives) * SYSTEM * SYSTEM,
        [out_partial, points.first_block],
        [out_systems],
        device,
        seconds_per_thread=1e-9 * points.block_count / max(1, len(primitives)),
    )


def normal_equations(primitives: PrimitiveSet, points: OwnedPoints, beta: float) -> np.ndarray:
    """One system a primitive: sums over its points of the products of (Jacobian row, residual) with itself.

    Args:
        primitives: the assembly.
        points: its points by owner.
        beta: sharpness of the occupancy, per normalised unit.

    Returns:
        (primitive_count, SYSTEM, SYSTEM) float32, symmetric: J^T J in the first TANGENT rows and columns, J^T r in
        the last column, r^T r in the corner.
    """
    device = primitives.device
    partial = wp.zeros(max(1, points.block_count * SYSTEM * SYSTEM), dtype=float, device=device)
    systems = wp.zeros(max(1, len(primitives) * SYSTEM * SYSTEM), dtype=float, device=device)
    if len(primitives):
        normal_equations_at(primitives, points, beta, partial, systems)
    return systems.numpy()[: len(primitives) * SYSTEM * SYSTEM].reshape(-1, SYSTEM, SYSTEM)
