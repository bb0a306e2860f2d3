"""Greedy selection of candidates by gain, several beginnings side by side, then removals and swaps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...kernels.select.coverage_sets import CandidateCoverage
from ..objective.objective import Tally
from ..presets import SelectConfig
from .cover import Cover
from .greedy_cover import LEAST_AIR, GreedyCover

EXCHANGES = 3
"""Passes over the chosen ones in search of something better; later passes hardly ever find any."""
REPLACEMENTS = 8
"""Candidates that may take the place of one."""
TWIN = 0.6
"""Share of common points, of the points in either, above which a candidate is another try at the same part."""
BATCH = 16
"""Replacements of several that are tried side by side: once one is made, the rest must be tried anew."""
WIDE_LOOK = 24
"""Candidates whose addition alone does not pay that are tried as a replacement of several."""


def select(
    coverage: CandidateCoverage,
    tally: Tally,
    alpha: float,
    config: SelectConfig,
    false_volume: float = 1.0,
    start: Sequence[int] = (),
    most: int = 1_000_000,
) -> list[int]:
    """Choose candidates that raise the objective of their hard union.

    Args:
        coverage: which sample points each candidate holds.
        tally: the objective's sums.
        alpha: price of a primitive.
        config: width of the search.
        false_volume: weight of volume outside the target: above 1, precise candidates win over bulky ones.
        start: candidates that are chosen already; they may be swapped out again.
        most: most primitives to choose.

    Returns:
        Indices in the order of choice.
    """
    root = GreedyCover(coverage, tally, alpha, false_volume)
    for index in start:
        root.add(index)
    beginnings = [root]
    if not start:
        gains = root.gains()
        leaders = [int(i) for i in np.argsort(-gains, kind="stable")[: config.beam] if gains[i] > 0]
        beginnings = [root.copy() for _ in leaders]
        for beginning, leader in zip(beginnings, leaders, strict=True):
            beginning.add(leader)
    for beginning in beginnings:
        _grow(beginning, most)
    if not beginnings:
        return []
    best = max(beginnings, key=GreedyCover.score)
    _exchange(best, most)
    return best.chosen


def _grow(choice: GreedyCover, most: int) -> None:
    """Add the best candidate while one gains."""
    while len(choice.chosen) < most:
        leader, gain = choice.best_addition()
        if gain <= 0:
            return
        choice.add(leader)


def _exchange(choice: GreedyCover, most: int) -> None:
    """Moves that lift the objective where no single addition does: replace one by several, or several by one."""
    # What failed since the choice last changed would fail again.
    failed: set[int] = set()
    for _ in range(EXCHANGES):
        before = choice.score()
        for member in list(choice.chosen):
            if member in failed:
                continue
            if _try_without(choice, member, most):
                failed.clear()
            else:
                failed.add(member)
        _exchange_leaders(choice, most, failed)
        if choice.score() <= before + 1e-6:
            return


def _exchange_leaders(choice: GreedyCover, most: int, failed: set[int]) -> None:
    """Let leaders come in, one after another, for the members that they make redundant, where the objective rises."""
    waiting = _leaders(choice)
    while waiting:
        waiting = [leader for leader in waiting if leader not in choice.chosen and leader not in failed]
        batch, waiting = waiting[:BATCH], waiting[BATCH:]
        for place, leavers in enumerate(choice.replace_redundant(batch)):
            if leavers is None or len(choice.chosen) + 1 - len(leavers) > most:
                failed.add(batch[place])
                continue
            choice.add(batch[place])
            for leaver in leavers:
                choice.remove(leaver)
            failed.clear()
            waiting = batch[place + 1 :] + waiting
            break


def _leaders(choice: GreedyCover) -> list[int]:
    """Candidates that may pay if others leave: those that hold most of two members or more, and those that nearly pay
    as it is."""
    gains, absorbed = choice.gains(), choice.absorbs().sum(1)
    nearly = np.argsort(-gains, kind="stable")[:WIDE_LOOK]
    merging = np.lexsort((-gains, -absorbed))[:WIDE_LOOK]
    merging = merging[absorbed[merging] > 1]
    return list(dict.fromkeys([*merging.tolist(), *nearly.tolist()]))


def _try_without(choice: GreedyCover, member: int, most: int) -> bool:
    """Let the best few of another kind come in for a member; undo that unless the objective rose. Whether it did.

    What is much like the member is left out: the greedy choice would only take it back.
    """
    before, saved = choice.score(), choice.save()
    barred = choice.likeness(member) > TWIN
    choice.remove(member)
    for _ in range(REPLACEMENTS):
        leader, gain = choice.best_addition(barred)
        if gain <= 0 or len(choice.chosen) >= most:
            break
        choice.add(leader)
    rose = choice.score() > before + 1e-6
    if not rose:
        choice.restore(saved)
    return rose


def prune(coverage: CandidateCoverage, tally: Tally, alpha: float) -> list[int]:
    """Indices that remain after removing, one by one, the primitive whose absence raises the objective most."""
    choice = Cover(coverage, tally, alpha)
    for index in range(coverage.count):
        choice.add(index)
    while len(choice.chosen) > 1:
        leaver, gain = choice.best_removal()
        if gain <= 0:
            break
        choice.remove(leaver)
    return sorted(choice.chosen)


def without_air(coverage: CandidateCoverage, tally: Tally) -> list[int]:
    """Indices that remain after removing, one by one, primitives that alone hold more air than solid, worst first.

    Where a fit is poor, such a one still raises an IoU: its share of solid is higher than that of the rest. It shows as
    a slab across an ornament or a vessel's mouth that nobody would have put there. One primitive always remains.
    """
    choice = Cover(coverage, tally, 0.0)
    for index in range(coverage.count):
        choice.add(index)
    while len(choice.chosen) > 1:
        solid, air = choice.alone().T
        worst = int(np.argmax(air - solid))
        if air[worst] - solid[worst] < LEAST_AIR:
            break
        choice.remove(choice.chosen[worst])
    return sorted(choice.chosen)
