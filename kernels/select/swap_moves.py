"""Candidates that come in for members of a choice, all tried side by side on the same choice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..runtime.launch import VECTOR_OPTIONS, launch
from .coverage_gains import CoverageCounts
from .coverage_sets import WORD, WORD_C
from .objective_sums import BOX_KIND_C, HARD_SUMS, HARD_SUMS_C, TWICE_C, HardPrices, Prices, hard_objective

wp.set_module_options(VECTOR_OPTIONS)


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
            at = base + m * HARD_SUMS_C + entry
            out_sums[at] = out_sums[at] + change
            left = others


@wp.struct
class Choice:
    """The choice that newcomers come to."""

    members: wp.array[int]
    """Its candidates."""
    held: wp.array[wp.float64]
    """Sums of what it holds."""
    alone: wp.array[wp.float64]
    """(members * HARD_SUMS,): what it would lose with each member."""


@wp.struct
class HeldPoints:
    """The sample points, and which of them each candidate holds; see `CandidateCoverage`."""

    edges: wp.array[int]
    points: wp.array[int]
    bits: wp.array[wp.uint32]
    stride: int
    kind: wp.array[wp.uint8]
    weight: wp.array[wp.float64]


@wp.kernel
def replace_members_kernel(
    first: int,
    newcomers: wp.array[int],
    choice: Choice,
    holders: wp.array[wp.uint32],
    stride: int,
    samples: HeldPoints,
    prices: HardPrices,
    # outputs
    out_gone: wp.array[wp.uint32],
    out_sums: wp.array[wp.float64],
    out_held: wp.array[wp.float64],
    out_leavers: wp.array[int],
    out_score: wp.array[wp.float64],
):
    """Add one newcomer and, while that raises the objective, remove the member whose absence raises it most.

    `holders` has `stride` words for each point, a bit a member. Of each newcomer, out_gone has a bit for each member
    that left, out_sums what it would lose with each one, out_leavers the numbers in the list of members of those that
    left, in order, and -1 from there on.
    """
    t = first + wp.tid()
    count = choice.members.shape[0]
    newcomer = newcomers[t]
    newcomer_bit = wp.uint32(newcomer % WORD_C)
    gone = t * stride
    base = t * count * HARD_SUMS_C
    now = 2 * t * HARD_SUMS_C
    after = now + HARD_SUMS_C
    for word in range(stride):
        out_gone[gone + word] = wp.uint32(0)
    for m in range(count):
        out_leavers[t * count + m] = -1
    for entry in range(count * HARD_SUMS_C):
        out_sums[base + entry] = choice.alone[entry]
    for entry in range(HARD_SUMS_C):
        out_held[now + entry] = choice.held[entry]
    changed = int(newcomer)
    for removed in range(count + 1):
        # The newcomer's points are held once more, or the last leaver's once less: by how many members else?
        for i in range(samples.edges[changed], samples.edges[changed + 1]):
            point = samples.points[i]
            row = point * stride
            others = int(0)
            for word in range(stride):
                others += int(wp.bit_count(holders[row + word] & ~out_gone[gone + word]))
            number = int(samples.kind[point])
            twice = wp.where(number >= BOX_KIND_C, wp.float64(1.0), wp.float64(0.0))
            amount = samples.weight[point]
            if removed > 0:
                held = samples.bits[point * samples.stride + newcomer / WORD_C]
                others += int((held >> newcomer_bit) & wp.uint32(1))
                twice = -twice
                amount = -amount
            if others == 0:
                out_held[now + number] = out_held[now + number] + amount
            elif others == 1:
                out_held[now + TWICE_C] = out_held[now + TWICE_C] + twice
                add_to_holders(holders, row, out_gone, gone, stride, number, -amount, out_sums, base)
                add_to_holders(holders, row, out_gone, gone, stride, TWICE_C, twice, out_sums, base)
            elif others == 2 and number >= BOX_KIND_C:
                add_to_holders(holders, row, out_gone, gone, stride, TWICE_C, -twice, out_sums, base)
        score = hard_objective(out_held, now, count + 1 - removed, prices)
        out_score[t] = score
        best = int(-1)
        best_gain = wp.float64(0.0)
        for m in range(count):
            word = m / WORD_C
            if (out_gone[gone + word] >> wp.uint32(m - word * WORD_C)) & wp.uint32(1) == wp.uint32(0):
                for entry in range(HARD_SUMS_C):
                    out_held[after + entry] = out_held[now + entry] - out_sums[base + m * HARD_SUMS_C + entry]
                gain = hard_objective(out_held, after, count - removed, prices) - score
                if gain > best_gain:
                    best = m
                    best_gain = gain
        if best < 0:
            break
        out_leavers[t * count + removed] = best
        word = best / WORD_C
        out_gone[gone + word] = out_gone[gone + word] | (wp.uint32(1) << wp.uint32(best - word * WORD_C))
        changed = choice.members[best]


def replace_members(
    counts: CoverageCounts, newcomers: Sequence[int], members: Sequence[int], prices: Prices
) -> tuple[np.ndarray, list[list[int]]]:
    """Swap move of each newcomer to a choice: members leave, one by one, while that raises the objective.

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
    choice = Choice()
    choice.members, choice.held = chosen, counts.held.array
    choice.alone = wp.array(counts.removals(members).ravel(), dtype=wp.float64, device=device)
    samples = HeldPoints()
    samples.edges, samples.points = coverage.edges, coverage.points
    samples.bits, samples.stride = coverage.bits(), coverage.stride
    samples.kind, samples.weight = counts.kind, counts.weight
    leavers = wp.empty(max(1, tried * count), dtype=int, device=device)
    score = wp.empty(max(1, tried), dtype=wp.float64, device=device)
    launch(
        replace_members_kernel,
        tried,
        [asked, choice, holders, stride, samples, prices.argument],
        [
            wp.empty(max(1, tried * stride), dtype=wp.uint32, device=device),
            wp.empty(max(1, tried * count * HARD_SUMS), dtype=wp.float64, device=device),
            wp.empty(max(1, tried * 2 * HARD_SUMS), dtype=wp.float64, device=device),
            leavers,
            score,
        ],
        device,
        seconds_per_thread=3e-5,
    )
    places = leavers.numpy()[: tried * count].reshape(tried, count)
    return score.numpy()[:tried], [[members[place] for place in row if place >= 0] for row in places]
