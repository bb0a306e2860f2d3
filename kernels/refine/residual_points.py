"""The points of a refinement's loss, and what each contributes: its error, and the rows that it asks for.

Up to one row in the normal equations for each of the `RESIDUALS`. Own: the primitive nearest to it, with the union's
error. Blended: the second nearest, with the same error, where the two blend. Covering: the second nearest again, pushed
out of a point that it covers too. Rows so far from the surface that their slope is nil are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..field.culling import BlockBounds, bound_blocks
from ..field.hilbert import curve_codes
from ..field.points import BLOCK, BLOCK_C, PointBlocks, at, point_blocks
from ..runtime.launch import VECTOR_OPTIONS, launch
from ..vector_math import smaller
from .nearest_primitives import NearestPrimitives, Owners
from .residuals import FLAT, RESIDUAL_COUNT, RESIDUALS, ResidualWeights

wp.set_module_options(VECTOR_OPTIONS)

MASK = 0.1
"""Points farther than this from both the target and the assembly, outside, are not in the loss (the paper's mask)."""
MASK_C = wp.constant(MASK)

RESIDUAL_COUNT_C = wp.constant(RESIDUAL_COUNT)
OF_SECOND_C = wp.constant(sum(residual.of_second << n for n, residual in enumerate(RESIDUALS)))
"""Bits of the rows of the second nearest primitive."""


@dataclass(frozen=True)
class ResidualPoints:
    """Points in an order in which neighbours are neighbours in space; padding has weight 0."""

    blocks: PointBlocks
    bounds: BlockBounds
    distance: wp.array
    """(padded points,) float32, signed distance that the union should have, normalised units."""
    root_weight: wp.array
    """(padded points,) float32, square root of the weight."""


@dataclass(frozen=True)
class Contributions:
    """Contributions of the points to the loss and its rows at one moment."""

    loss: wp.array
    """(block_count,) float32: weighted squared errors, with those of covered points."""
    kind: wp.array
    """(padded points,) int32: a bit for each of the `RESIDUALS` that makes a row."""
    counts: wp.array
    """(primitive_count * block_count,) int32, primitive-major: rows of each primitive in each block."""


def residual_points(
    points: np.ndarray, distance: np.ndarray, weight: np.ndarray, device: wp.Device
) -> ResidualPoints:
    """Sort points along a space-filling curve and put them on the device.

    Args:
        points: (n, 3), normalised frame, at least one.
        distance: (n,) signed distance of the target.
        weight: (n,), not negative.
        device: where they go.
    """
    order = _order(points, distance)
    blocks = point_blocks(points[order], device)

    def padded(values: np.ndarray) -> wp.array:
        column = np.zeros(blocks.x.shape[0], np.float32)
        column[: len(order)] = values[order]
        return wp.array(column, dtype=float, device=device)

    return ResidualPoints(blocks, bound_blocks(blocks), padded(distance), padded(np.sqrt(weight)))


def _order(points: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Points near the target first, each part along the curve; then blocks in turn to the first and second half.

    Blocks far from the target are mostly left out later; launches over halves of the blocks share what remains.
    """
    far = (np.abs(distance) > MASK).astype(np.uint16) << 15
    order = np.argsort(curve_codes(points) | far, kind="stable")
    block = np.arange(len(order)) // BLOCK
    # The last block may be a short one: it stays where it is.
    whole = len(order) // BLOCK
    turn = np.where(block < whole, (block % 2) * whole + block // 2, 2 * whole)
    return order[np.argsort(turn, kind="stable")]


def contributions(primitive_count: int, points: ResidualPoints) -> Contributions:
    """Uninitialised arrays for `weigh_points`."""
    device, size, blocks = points.blocks.device, points.blocks.x.shape[0], points.blocks.block_count
    return Contributions(
        wp.empty(blocks, dtype=float, device=device),
        wp.empty(size, dtype=int, device=device),
        wp.empty(max(1, primitive_count * blocks), dtype=int, device=device),
    )


MOVE = wp.constant(0.04)
"""Farther than this, normalised units, no primitive should move before the sharpness rises again."""


@wp.kernel
def drop_blocks_kernel(
    first: int,
    field: wp.array[float],
    runner_up: wp.array[float],
    distance: wp.array[float],
    betas: wp.array[float],
    # outputs
    out_live: wp.array[int],
):
    """Leave out a block if the loss of all its points stays what it is, however primitives move by less than MOVE.

    So it does far from the target's surface and the union's, inside or outside, where no second surface is near.
    """
    block = first + wp.tid()
    flat = FLAT / betas[0]
    live = int(0)
    for j in range(BLOCK_C):
        i = block * BLOCK_C + j
        d = distance[i]
        near = smaller(smaller(wp.abs(field[i]), wp.abs(runner_up[i])) - MOVE, wp.abs(d))
        seen = smaller(field[i] - MOVE, d)
        live += wp.where(near < flat, wp.where(seen < MASK_C, 1, 0), 0)
    out_live[block] = live


def drop_blocks(points: ResidualPoints, owners: NearestPrimitives, betas: wp.array) -> None:
    """Write `owners.live` from the union at all points; until it is written again these blocks are left out."""
    launch(
        drop_blocks_kernel,
        points.blocks.block_count,
        [owners.field, owners.runner_up, points.distance, betas],
        [owners.live],
        points.blocks.device,
        seconds_per_thread=BLOCK * 1e-9,
    )


# Loops over the table are in functions: static expressions unroll all loops around them.
@wp.func
def point_loss(
    field: float, runner_up: float, target: float, seen: float, beta: float, weights: ResidualWeights
) -> float:
    """Weighted squared residuals of a point; `seen` is the root of its weight, or 0."""
    total = float(0.0)
    for n in range(RESIDUAL_COUNT_C):
        if wp.static(RESIDUALS[n].error is not None):
            error = seen * wp.static(RESIDUALS[n].error)(field, runner_up, target, beta)
            total += weights[n] * error * error
    return total


@wp.func
def point_kind(field: float, runner_up: float, share: float, seen: float, beta: float) -> int:
    """Bits of the rows that a point makes."""
    kind = int(0)
    for n in range(RESIDUAL_COUNT_C):
        has_row = wp.static(RESIDUALS[n].has_row)(field, runner_up, share, beta)
        kind += wp.where(seen * has_row > 0.0, 1 << n, 0)
    return kind


@wp.kernel
def weigh_points_kernel(
    first: int,
    owners: Owners,
    distance: wp.array[float],
    root_weight: wp.array[float],
    betas: wp.array[float],
    weights: ResidualWeights,
    primitive_count: int,
    block_count: int,
    # outputs
    out_loss: wp.array[float],
    out_kind: wp.array[int],
    out_counts: wp.array[int],
):
    """Loss of one block, the rows that its points ask for, and how many each primitive gets."""
    block = first + wp.tid()
    base = block * BLOCK_C
    for k in range(primitive_count):
        out_counts[k * block_count + block] = 0
    out_loss[block] = 0.0
    if owners.live[block] == 0:
        return
    beta = betas[0]
    total = float(0.0)
    for j in range(BLOCK_C):
        i = base + j
        u = at(owners.field, i)
        d = distance[i]
        r = at(owners.runner_up, i)
        w = root_weight[i]
        seen = wp.where(u < MASK_C, w, wp.where(d < MASK_C, w, 0.0))
        total += point_loss(u, r, d, seen, beta, weights)
        out_kind[i] = point_kind(u, r, at(owners.share, i), seen, beta)
    out_loss[block] = total
    for j in range(BLOCK_C):
        kind = out_kind[base + j]
        if kind != 0:
            of_second = int(wp.bit_count(kind & OF_SECOND_C))
            of_owner = int(wp.bit_count(kind)) - of_second
            if of_owner != 0:
                place = owners.owner[base + j] * block_count + block
                out_counts[place] = out_counts[place] + of_owner
            if of_second != 0:
                place = owners.second[base + j] * block_count + block
                out_counts[place] = out_counts[place] + of_second


def weigh_points(
    points: ResidualPoints,
    owners: NearestPrimitives,
    primitive_count: int,
    betas: wp.array,
    weights: Sequence[float],
    out: Contributions,
) -> None:
    """Loss and rows of every block.

    Args:
        points: of the loss.
        owners: from `find_owners` at these points.
        primitive_count: of the assembly.
        betas: (primitive_count,) sharpness of the occupancy, all alike.
        weights: of the RESIDUALS.
        out: from `contributions`.
    """
    launch(
        weigh_points_kernel,
        points.blocks.block_count,
        [
            *(owners.argument, points.distance, points.root_weight, betas, ResidualWeights(*weights)),
            *(primitive_count, points.blocks.block_count),
        ],
        [out.loss, out.kind, out.counts],
        points.blocks.device,
        seconds_per_thread=BLOCK * 3e-9,
    )
