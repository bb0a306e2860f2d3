"""Which candidates make the assembly: greedy by gain, several beginnings side by side, then removals and swaps."""

from __future__ import annotations

import numpy as np

from .config import SelectConfig
from .objective import Chooser, Tally

EXCHANGES = 3
"""Passes over the chosen ones in search of something better; later passes hardly ever find any."""


def select(
    bits: np.ndarray,
    tally: Tally,
    alpha: float,
    config: SelectConfig,
    start: int = 0,
    most: int = 1_000_000,
) -> list[int]:
    """Choose candidates that raise the objective of their hard union.

    Args:
        bits: (candidates, n) bool: which sample points each candidate holds.
        tally: the objective's sums.
        alpha: price of a primitive.
        config: beam and weight of false volume.
        start: the first so many candidates are chosen already; they may be swapped out again.
        most: most primitives to choose.

    Returns:
        Indices in the order of choice.
    """
    root = Chooser(bits, tally, alpha)
    for index in range(start):
        root.add(index)
    beginnings = [root]
    if not start:
        gains = root.gains(config.false_volume)
        leaders = [int(i) for i in np.argsort(-gains, kind="stable")[: config.beam] if gains[i] > 0]
        beginnings = [root.copy() for _ in leaders]
        for beginning, leader in zip(beginnings, leaders, strict=True):
            beginning.add(leader)
    for beginning in beginnings:
        _grow(beginning, config, most)
        _exchange(beginning)
    return max(beginnings, key=Chooser.score).chosen if beginnings else []


def _grow(choice: Chooser, config: SelectConfig, most: int) -> None:
    """Add the best candidate while one gains, first with false volume weighed more, then by the objective itself."""
    for false_volume in (config.false_volume, 1.0):
        while len(choice.chosen) < most:
            leader, gain = choice.best_addition(false_volume)
            if gain <= 0:
                break
            choice.add(leader)


def _exchange(choice: Chooser) -> None:
    """Take one out, or put a better one in its place, as long as that raises the objective."""
    for _ in range(EXCHANGES):
        changed = False
        for member in list(choice.chosen):
            before = choice.score()
            choice.remove(member)
            leader, gain = choice.best_addition()
            if leader != member and choice.score() + max(gain, 0.0) > before + 1e-6:
                if gain > 0:
                    choice.add(leader)
                changed = True
            else:
                choice.add(member)
        if not changed:
            return


def prune(bits: np.ndarray, tally: Tally, alpha: float) -> list[int]:
    """Indices that remain after removing, one by one, the primitive whose absence raises the objective most."""
    choice = Chooser(bits, tally, alpha)
    for index in range(len(bits)):
        choice.add(index)
    while len(choice.chosen) > 1:
        before = choice.score()
        scores = {}
        for member in list(choice.chosen):
            choice.remove(member)
            scores[member] = choice.score()
            choice.add(member)
        best = max(sorted(scores), key=lambda member: scores[member])
        if scores[best] < before:
            break
        choice.remove(best)
    return sorted(choice.chosen)
