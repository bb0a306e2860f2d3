"""Candidates that come in for members of a choice, all tried side by side on the same choice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..runtime.launch import VECTOR_OPTIONS, launch
from .coverage_gains import SUMS, SUMS_C, CoverageCounts
from .coverage_sets import WORD, WORD_C

wp.set_module_options(VECTOR_OPTIONS)


@wp.struct
class Prices:
    """What an objective is made of beside the sums of a set."""

    near_total: wp.float64
    """Weight of the near points in the target."""
    box_total: wp.float64
    """The same of the box's."""
    primitive: wp.float64
    """Price of a primitive."""
    overlap: wp.float64
    """Price of volume held twice, as a share."""
    false_volume: wp.float64
    """Weight of volume outside the target."""


@wp.func
def objective_of(held: wp.array[wp.float64], base: int, count: int, prices: Prices) -> wp.float64:
    """The objective of `count` primitives from the sums at `base` (as `Tally.objective`)."""
    least = wp.float64(1.0e-9)
    box_in = held[base + 2]
    box_out = held[base + 3]
    near = held[base] / wp.max(prices.near_total + prices.false_volume * held[base + 1], least)
    volume = box_in / wp.max(prices.box_total + prices.false_volume * box_out, least)
    overlap = held[base + 4] / wp.max(box_in + box_out, wp.float64(1.0))
    return wp.float64(0.5) * (near + volume) - prices.primitive * wp.float64(count) - prices.overlap * overlap


@wp.kernel
def mark_members_kernel(
    first: int,
    members: wp.array[int],
    edges: wp.array[int],
    points: wp.array[int],
    stride: int,
    # outputs
    out_holders: wp.array[wp.uint32],
):
    """Set the bits of the members of one word at the points that they hold."""
    word = first + wp.tid()
    for m in range(word * WORD_C, wp.min(members.shape[0], (word + 1) * WORD_C)):
        bit = wp.uint32(1) << wp.uint32(m - word * WORD_C)
        for i in range(edges[members[m]], edges[members[m] + 1]):
            at = points[i] * stride + word
            out_holders[at] = out_holders[at] | bit


@wp.func
def add_to_holders(
    holders: wp.array[wp.uint32],
    row: int,
    gone: wp.array[wp.uint32],
    gone_row: int,
    stride: int,
    entry: int,
    change: wp.float64,
    # outputs
    out_sums: wp.array[wp.float64],
    base: int,
):
    """Add to one sum of every member left that holds the point whose holders begin at `row`."""
    for word in range(stride):
        left = holders[row + word] & ~gone[gone_row + word]
        while left != wp.uint32(0):
            others = left & (left - wp.uint32(1))
            m = word * WORD_C + int(wp.bit_count((left ^ others) - wp.uint32(1)))
            at = base + m * SUMS_C + entry
            out_sums[at] = out_sums[at] + change
            left = others


@wp.kernel
def replace_members_kernel(
    first: int,
    newcomers: wp.array[int],
    members: wp.array[int],
    alone: wp.array[wp.float64],
    edges: wp.array[int],
    points: wp.array[int],
    bits: wp.array[wp.uint32],
    bit_stride: int,
    holders: wp.array[wp.uint32],
    stride: int,
    kind: wp.array[wp.uint8],
    weight: wp.array[wp.float64],
    held: wp.array[wp.float64],
    prices: Prices,
    # outputs
    out_gone: wp.array[wp.uint32],
    out_sums: wp.array[wp.float64],
    out_held: wp.array[wp.float64],
    out_leavers: wp.array[int],
    out_score: wp.array[wp.float64],
):
    """Add one newcomer and, while that raises the objective, remove the member whose absence raises it most.

    `alone` is what the choice would lose with each member; `holders` has `stride` words for each point, a bit a
    member. Of each newcomer, out_gone has a bit for each member that left, out_sums what it would lose with each one,
    out_leavers the numbers in the list of members of those that left, in order, and -1 from there on.
    """
    t = first + wp.tid()
    count = members.shape[0]
    newcomer = newcomers[t]
    newcomer_word = newcomer / WORD_C
    newcomer_bit = wp.uint32(newcomer - newcomer_word * WORD_C)
    gone = t * stride
    base = t * count * SUMS_C
    now = 2 * t * SUMS_C
    after = now + SUMS_C
    for word in range(stride):
        out_gone[gone + word] = wp.uint32(0)
    for m in range(count):
        out_leavers[t * count + m] = -1
    for entry in range(count * SUMS_C):
        out_sums[base + entry] = alone[entry]
    for entry in range(SUMS_C):
        out_held[now + entry] = held[entry]
    changed = int(newcomer)
    for removed in range(count + 1):
        # The newcomer's points are held once more, or the last leaver's once less: by how many members else?
        for i in range(edges[changed], edges[changed + 1]):
            point = points[i]
            row = point * stride
            others = int(0)
            for word in range(stride):
                others += int(wp.bit_count(holders[row + word] & ~out_gone[gone + word]))
            number = int(kind[point])
            twice = wp.where(number >= 2, wp.float64(1.0), wp.float64(0.0))
            amount = weight[point]
            if removed > 0:
                others += int((bits[point * bit_stride + newcomer_word] >> newcomer_bit) & wp.uint32(1))
                twice = -twice
                amount = -amount
            if others == 0:
                out_held[now + number] = out_held[now + number] + amount
            elif others == 1:
                out_held[now + SUMS_C - 1] = out_held[now + SUMS_C - 1] + twice
                add_to_holders(holders, row, out_gone, gone, stride, number, -amount, out_sums, base)
                add_to_holders(holders, row, out_gone, gone, stride, SUMS_C - 1, twice, out_sums, base)
            elif others == 2 and number >= 2:
                add_to_holders(holders, row, out_gone, gone, stride, SUMS_C - 1, -twice, out_sums, base)
        score = objective_of(out_held, now, count + 1 - removed, prices)
        out_score[t] = score
        best = int(-1)
        best_gain = wp.float64(0.0)
        for m in range(count):
            word = m / WORD_C
            if (out_gone[gone + word] >> wp.uint32(m - word * WORD_C)) & wp.uint32(1) == wp.uint32(0):
                for entry in range(SUMS_C):
                    out_held[after + entry] = out_held[now + entry] - out_sums[base + m * SUMS_C + entry]
                gain = objective_of(out_held, after, count - removed, prices) - score
                if gain > best_gain:
                    best = m
                    best_gain = gain
        if best < 0:
            break
        out_leavers[t * count + removed] = best
        word = best / WORD_C
        out_gone[gone + word] = out_gone[gone + word] | (wp.uint32(1) << wp.uint32(best - word * WORD_C))
        changed = members[best]


def replace_members(
    counts: CoverageCounts, newcomers: Sequence[int], members: Sequence[int], prices: Prices
) -> tuple[np.ndarray, list[list[int]]]:
    """What each newcomer to a choice makes of it if members leave, one by one, while that raises the objective.

    Args:
        counts: of the choice, which stays as it is.
        newcomers: candidates, each tried alone.
        members: of the choice; of two that are equally missed the first leaves.
        prices: of the objective.

    Returns:
        Objectives (newcomers,), and the members that leave for each.
    """
    coverage, device = counts.coverage, counts.device
    tried, count, stride = len(newcomers), len(members), -(-len(members) // WORD)
    asked, chosen = (
        wp.array(np.array(values, np.int32), dtype=int, device=device) for values in (newcomers, members)
    )
    holders = wp.zeros(max(1, coverage.point_count * stride), dtype=wp.uint32, device=device)
    launch(
        mark_members_kernel,
        stride,
        [chosen, coverage.edges, coverage.points, stride],
        [holders],
        device,
        seconds_per_thread=5e-5,
    )
    leavers = wp.empty(max(1, tried * count), dtype=int, device=device)
    score = wp.empty(max(1, tried), dtype=wp.float64, device=device)
    launch(
        replace_members_kernel,
        tried,
        [
            asked,
            chosen,
            wp.array(counts.removals(members).ravel(), dtype=wp.float64, device=device),
            coverage.edges,
            coverage.points,
            coverage.bits(),
            coverage.stride,
            holders,
            stride,
            counts.kind,
            counts.weight,
            counts.held.array,
            prices,
        ],
        [
            wp.empty(max(1, tried * stride), dtype=wp.uint32, device=device),
            wp.empty(max(1, tried * count * SUMS), dtype=wp.float64, device=device),
            wp.empty(max(1, tried * 2 * SUMS), dtype=wp.float64, device=device),
            leavers,
            score,
        ],
        device,
        seconds_per_thread=3e-5,
    )
    places = leavers.numpy()[: tried * count].reshape(tried, count)
    return score.numpy()[:tried], [[members[place] for place in row if place >= 0] for row in places]
