"""The objective of a set of primitives from sums over sample points, for Warp and for NumPy, and nowhere else.

    O = (near IoU + volume IoU) / 2 - primitive price * n - overlap price * overlap - unoverlap price * unoverlap

The near IoU is taken on weighted points near the target's surface, the volume IoU on uniform points of its box.
Overlap is the share of the union's volume that lies in more than one primitive, unoverlap the share that lies in none,
only in the blends between them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import warp as wp


class Sums(NamedTuple):
    """Sums over the points of a union, each a number or one for each of several unions (...,)."""

    near_in: Any
    """Weight of its points near the surface that lie in the target."""
    near_out: Any
    """The same outside the target."""
    box_in: Any
    """Weight of its points of the box that lie in the target."""
    box_out: Any
    """The same outside the target."""
    twice: Any
    """Number of points of the box in more than one primitive."""
    bare: Any = 0.0
    """Number of points of the box in no primitive; a hard union has none, and its kernels leave this column out."""


KINDS = 4
"""The kinds of points come first among the sums: 0 to 3, near or of the box, in the target or outside."""
BOX_KIND_C = wp.constant(2)
"""The first kind of points of the box."""
HARD_SUMS, SUMS = Sums._fields.index("bare"), len(Sums._fields)
"""Columns of a hard union, and of a smooth one."""
HARD_SUMS_C, SUMS_C = wp.constant(HARD_SUMS), wp.constant(SUMS)
NEAR_IN_C, NEAR_OUT_C, BOX_IN_C, BOX_OUT_C, TWICE_C, BARE_C = (wp.constant(column) for column in range(SUMS))


class Prices(NamedTuple):
    """Prices and totals of an objective, beside the sums of a set."""

    near_total: float
    """Weight of the near points in the target."""
    box_total: float
    """The same of the box's."""
    primitive: float
    """Price of a primitive."""
    overlap: float
    """Price of the share of the volume that lies in more than one primitive."""
    unoverlap: float
    """Price of the share of the volume that lies in none."""
    false_volume: float = 1.0
    """Weight of volume outside the target; 1 for the objective itself."""

    @property
    def argument(self) -> Any:
        """The prices as one argument of a kernel: a `HardPrices`."""
        prices = HardPrices()
        prices.near_total, prices.box_total = self.near_total, self.box_total
        prices.primitive, prices.overlap = self.primitive, self.overlap
        prices.false_volume = self.false_volume
        return prices


@wp.struct
class HardPrices:
    """`Prices` of a hard union as an argument of kernels."""

    near_total: wp.float64
    box_total: wp.float64
    primitive: wp.float64
    overlap: wp.float64
    false_volume: wp.float64


class Terms(NamedTuple):
    """The objective's terms, each a number or one for each of several unions (...,)."""

    near_iou: Any
    volume_iou: Any
    overlap: Any
    unoverlap: Any


def objective_terms(sums: Sums, prices: Prices) -> Terms:
    """IoUs and shares from sums, false volume weighed by its price."""
    volume = np.maximum(sums.box_in + sums.box_out, 1.0)
    return Terms(
        sums.near_in / np.maximum(prices.near_total + prices.false_volume * sums.near_out, 1e-9),
        sums.box_in / np.maximum(prices.box_total + prices.false_volume * sums.box_out, 1e-9),
        sums.twice / volume,
        sums.bare / volume,
    )


def objective(sums: Sums, primitive_count: int, prices: Prices) -> Any:
    """The objective, a number or (...,), of sets of `primitive_count` primitives each."""
    terms = objective_terms(sums, prices)
    return (
        0.5 * (terms.near_iou + terms.volume_iou)
        - prices.primitive * primitive_count
        - prices.overlap * terms.overlap
        - prices.unoverlap * terms.unoverlap
    )


@wp.func
def hard_objective(
    sums: wp.array[wp.float64], base: int, primitive_count: int, prices: HardPrices
) -> wp.float64:
    """The Warp twin of `objective` for a hard union, whose sums begin at `base`."""
    least = wp.float64(1.0e-9)
    box_in = sums[base + BOX_IN_C]
    box_out = sums[base + BOX_OUT_C]
    near = sums[base + NEAR_IN_C] / wp.max(
        prices.near_total + prices.false_volume * sums[base + NEAR_OUT_C], least
    )
    volume = box_in / wp.max(prices.box_total + prices.false_volume * box_out, least)
    overlap = sums[base + TWICE_C] / wp.max(box_in + box_out, wp.float64(1.0))
    return (
        wp.float64(0.5) * (near + volume)
        - prices.primitive * wp.float64(primitive_count)
        - prices.overlap * overlap
    )
