"""The points of a refinement's loss, and what each contributes: its error, and the rows that it asks for.

A point has up to three rows in the normal equations. OWN: the primitive nearest to it, with the union's error.
BLENDED: the second nearest, with the same error, where the two blend. COVERED: the second nearest again, pushed out of
a point that it covers too. Rows so far from the surface that their slope is nil are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..field.culling import BlockBounds, bound_blocks
from ..field.hilbert import curve_codes
from ..field.points import BLOCK, BLOCK_C, PointBlocks, point_blocks
from ..runtime.launch import VECTOR_OPTIONS, launch
from ..vector_math import smaller
from .nearest_primitives import COVERED_C, NearestPrimitives
from .soft_occupancy import soft_occupancy

wp.set_module_options(VECTOR_OPTIONS)

MASK = 0.1
"""Points farther than this from both the target and the assembly, outside, are not in the loss (the paper's mask)."""
MASK_C = wp.constant(MASK)

OWN, BLENDED, COVERING = wp.constant(1), wp.constant(2), wp.constant(4)
"""Bits of the rows that a point asks for."""

BLENDED_BELOW = wp.constant(0.98)
"""Share of the owner in the union below which the second nearest gets a row of it too."""

FLAT = wp.constant(6.0)
"""Distance in units of 1 / sharpness beyond which the occupancy has no slope to speak of: 1 % of the steepest."""


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
    """What the points contribute at one moment."""

    loss: wp.array
    """(block_count,) float32: weighted squared errors, with those of covered points."""
    kind: wp.array
    """(padded points,) int32: bits OWN, BLENDED, COVERING."""
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


@wp.kernel
def weigh_points_kernel(
    first: int,
    live: wp.array[int],
    field: wp.array[float],
    owner: wp.array[int],
    second: wp.array[int],
    runner_up: wp.array[float],
    share: wp.array[float],
    distance: wp.array[float],
    root_weight: wp.array[float],
    betas: wp.array[float],
    overlap: float,
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
    if live[block] == 0:
        return
    beta = betas[0]
    total = float(0.0)
    for j in range(BLOCK_C):
        i = base + j
        u = field[i]
        d = distance[i]
        r = runner_up[i]
        w = root_weight[i]
        seen = wp.where(u < MASK_C, w, wp.where(d < MASK_C, w, 0.0))
        error = seen * (soft_occupancy(u, beta) - soft_occupancy(d, beta))
        pushed = wp.where(r * beta < COVERED_C, seen, 0.0)
        crossing = pushed * soft_occupancy(r, beta)
        total += error * error + overlap * crossing * crossing
        steep = wp.where(wp.abs(beta * u) < FLAT, seen, 0.0)
        own = wp.where(steep > 0.0, OWN, 0)
        blended = wp.where(share[i] < BLENDED_BELOW, wp.where(steep > 0.0, BLENDED, 0), 0)
        covering = wp.where(wp.abs(beta * r) < FLAT, wp.where(pushed > 0.0, COVERING, 0), 0)
        out_kind[i] = own + blended + covering
    out_loss[block] = total
    for j in range(BLOCK_C):
        kind = out_kind[base + j]
        if kind != 0:
            if (kind & OWN) != 0:
                at = owner[base + j] * block_count + block
                out_counts[at] = out_counts[at] + 1
            if (kind & (BLENDED + COVERING)) != 0:
                at = second[base + j] * block_count + block
                more = out_counts[at]
                if (kind & BLENDED) != 0:
                    more += 1
                if (kind & COVERING) != 0:
                    more += 1
                out_counts[at] = more


def weigh_points(
    points: ResidualPoints,
    owners: NearestPrimitives,
    primitive_count: int,
    betas: wp.array,
    overlap: float,
    out: Contributions,
) -> None:
    """Loss and rows of every block.

    Args:
        points: of the loss.
        owners: from `find_owners` at these points.
        primitive_count: of the assembly.
        betas: (primitive_count,) sharpness of the occupancy, all alike.
        overlap: weight of the squared occupancy of a second primitive that covers a point.
        out: from `contributions`.
    """
    launch(
        weigh_points_kernel,
        points.blocks.block_count,
        [
            *(owners.live, owners.field, owners.owner, owners.second, owners.runner_up, owners.share),
            *(points.distance, points.root_weight, betas, float(overlap)),
            *(primitive_count, points.blocks.block_count),
        ],
        [out.loss, out.kind, out.counts],
        points.blocks.device,
        seconds_per_thread=BLOCK * 3e-9,
    )
