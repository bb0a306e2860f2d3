"""Points grouped by the primitive that answers for them, as the normal equations read them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import warp as wp

from ..field.points import points_argument

OWNER_BLOCK = 256
"""Points a thread sums over for one owner. Longer blocks vectorise better, shorter ones need less padding."""
OWNER_BLOCK_C = wp.constant(OWNER_BLOCK)


@wp.struct
class Wanted:
    """Targets and weights of the union at the rows' points, as an argument of kernels; see `PointBatches`."""

    target: wp.array[float]
    weight: wp.array[float]
    offset: wp.array[float]
    slope: wp.array[float]
    widening: wp.array[float]


@dataclass(frozen=True)
class PointBatches:
    """Blocks of OWNER_BLOCK points, and which primitive reads which block.

    Coordinates and values are float32 of whole blocks, in the normalised frame; padding has weight 0.
    """

    x: wp.array
    y: wp.array
    z: wp.array
    target: wp.array
    """Signed distance that the union should have; FAR where it should be empty."""
    weight: wp.array
    """Square root of the point's weight in the loss."""
    offset: wp.array
    """Union minus the owner's own distance."""
    slope: wp.array
    """Derivative of the union to the owner's own distance."""
    widening: wp.array
    """Derivative of the union to the owner's blend radius."""
    owners: wp.array
    """(pair_count,) int32, ascending: the primitive of each (primitive, block) pair."""
    point_blocks: wp.array
    """(pair_count,) int32: the block of points that the pair reads."""
    first_block: wp.array
    """(primitive_count + 1,) int32: pairs first_block[k] .. first_block[k + 1] - 1 belong to primitive k."""
    pair_count: int
    """Number of (primitive, block) pairs."""

    @cached_property
    def points(self) -> Any:
        """The coordinates as one argument of a kernel: a `Points`."""
        return points_argument(self.x, self.y, self.z)

    @cached_property
    def wanted(self) -> Any:
        """All other values of a point as one argument of a kernel: a `Wanted`."""
        wanted = Wanted()
        wanted.target, wanted.weight, wanted.offset = self.target, self.weight, self.offset
        wanted.slope, wanted.widening = self.slope, self.widening
        return wanted


def point_batches(
    points: np.ndarray,
    owners: np.ndarray,
    primitive_count: int,
    target: np.ndarray,
    weight: np.ndarray | None = None,
    offset: np.ndarray | None = None,
    slope: np.ndarray | None = None,
    widening: np.ndarray | None = None,
    device: wp.Device | None = None,
) -> PointBatches:
    """Sort points by owner into padded blocks that one primitive each reads.

    Args:
        points: (n, 3), normalised frame. A point that belongs to two primitives is given twice.
        owners: (n,) in 0 .. primitive_count - 1.
        primitive_count: number of primitives; some may own nothing.
        target: (n,) signed distance that the union should have.
        weight: (n,) square roots of weights, 1 by default.
        offset, slope, widening: (n,), 0, 1 and 0 by default.
        device: where the arrays go, the CPU by default.
    """
    order, blocks = _pack(np.asarray(owners, np.int64), primitive_count)
    return _gather(
        order,
        np.asarray(points, np.float32).reshape(-1, 3),
        [(target, 0.0), (weight, 1.0), (offset, 0.0), (slope, 1.0), (widening, 0.0)],
        np.arange(len(order) // OWNER_BLOCK),
        blocks,
        device,
    )


def shared_points(
    points: np.ndarray,
    regions: np.ndarray,
    readers: np.ndarray,
    target: np.ndarray,
    weight: np.ndarray | None = None,
    device: wp.Device | None = None,
) -> PointBatches:
    """Points of regions that many primitives read: all starts of a region share its blocks.

    Args:
        points: (n, 3), normalised frame.
        regions: (n,) the region of each point, 0 .. region_count - 1.
        readers: (primitive_count,) the region that each primitive reads.
        target: (n,) signed distance that a primitive of the point's region should have.
        weight: (n,) square roots of weights, 1 by default.
        device: where the arrays go, the CPU by default.
    """
    readers = np.asarray(readers, np.int64)
    region_count = int(readers.max(initial=-1)) + 1
    order, blocks = _pack(np.asarray(regions, np.int64), region_count)
    first = np.concatenate([[0], np.cumsum(blocks)])
    counts = blocks[readers]
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return _gather(
        order,
        np.asarray(points, np.float32).reshape(-1, 3),
        [(target, 0.0), (weight, 1.0), (None, 0.0), (None, 1.0), (None, 0.0)],
        np.repeat(first[readers], counts) + within,
        counts,
        device,
    )


def _pack(groups: np.ndarray, group_count: int) -> tuple[np.ndarray, np.ndarray]:
    """Index of the point at each place of the padded blocks (-1 in padding), and each group's block count."""
    counts = np.bincount(groups, minlength=group_count)
    blocks = -(-counts // OWNER_BLOCK)
    first = np.concatenate([[0], np.cumsum(blocks)])
    by_group = np.argsort(groups, kind="stable")
    within = np.arange(len(groups)) - np.repeat(np.cumsum(counts) - counts, counts)
    order = np.full(first[-1] * OWNER_BLOCK, -1, np.int64)
    order[first[groups[by_group]] * OWNER_BLOCK + within] = by_group
    return order, blocks


def _gather(
    order: np.ndarray,
    points: np.ndarray,
    values: list[tuple[np.ndarray | None, float]],
    point_blocks: np.ndarray,
    pairs: np.ndarray,
    device: wp.Device | None,
) -> PointBatches:
    """Device arrays in padded order; a value that is not given has its default at every point."""
    filled = order >= 0

    def pack(column: np.ndarray | None, default: float) -> wp.array:
        packed = np.zeros(max(1, len(order)), np.float32)
        packed[: len(order)][filled] = (
            default if column is None else np.asarray(column, np.float32)[order[filled]]
        )
        return wp.array(packed, dtype=float, device=device)

    def integers(given: np.ndarray) -> wp.array:
        return wp.array(np.asarray(given if len(given) else [0], np.int32), dtype=int, device=device)

    return PointBatches(
        *(pack(points[:, axis], 0.0) for axis in range(3)),
        *(pack(column, default) for column, default in values),
        owners=integers(np.repeat(np.arange(len(pairs)), pairs)),
        point_blocks=integers(point_blocks),
        first_block=integers(np.concatenate([[0], np.cumsum(pairs)])),
        pair_count=int(pairs.sum()),
    )
