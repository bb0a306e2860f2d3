"""Which candidates make the assembly: greedy by gain, several beginnings side by side, then removals and swaps."""

from __future__ import annotations

import numpy as np

from .config import SelectConfig
from .objective import Score, Tally


def select(
    bits: np.ndarray,
    tally: Tally,
    alpha: float,
    config: SelectConfig,
    start: list[int] | None = None,
    most: int = 1_000_000,
) -> tuple[list[int], Score]:
    """Choose candidates that raise the objective.

    Args:
        bits: (candidates, n) bool: which sample points each candidate holds.
        tally: the objective's sums.
        alpha: price of a primitive.
        config: beam and weight of false volume.
        start: candidates chosen already; they may be swapped out again.
        most: most primitives to choose.

    Returns:
        Indices in the order of choice, and the score of their hard union.
    """
    weights = bits.astype(np.float32)
    beginnings: list[list[int]] = [list(start or [])]
    if not beginnings[0]:
        gains = tally.gains(weights, np.zeros(bits.shape[1], np.int32), 0, alpha, config.false_volume)
        leaders = np.argsort(-gains, kind="stable")[: config.beam]
        beginnings = [[int(leader)] for leader in leaders if gains[leader] > 0]
    best: tuple[list[int], Score] | None = None
    for beginning in beginnings:
        chosen = _grow(beginning, bits, weights, tally, alpha, config, most)
        chosen = _exchange(chosen, bits, weights, tally, alpha, most)
        score = tally.score_counts(bits[chosen].sum(0, dtype=np.int32), len(chosen), alpha)
        if best is None or score.objective > best[1].objective:
            best = chosen, score
    if best is None:
        return [], tally.score_counts(np.zeros(bits.shape[1], np.int32), 0, alpha)
    return best


def _grow(
    beginning: list[int],
    bits: np.ndarray,
    weights: np.ndarray,
    tally: Tally,
    alpha: float,
    config: SelectConfig,
    most: int,
) -> list[int]:
    """Add the best candidate while one gains, first with false volume weighed more, then by the objective itself."""
    chosen = list(beginning)
    counts = bits[chosen].sum(0, dtype=np.int32)
    for false_volume in (config.false_volume, 1.0):
        while len(chosen) < most:
            gains = tally.gains(weights, counts, len(chosen), alpha, false_volume)
            gains[chosen] = -np.inf
            leader = int(np.argmax(gains))
            if gains[leader] <= 0:
                break
            chosen.append(leader)
            counts = counts + bits[leader]
    return chosen


def _exchange(
    chosen: list[int], bits: np.ndarray, weights: np.ndarray, tally: Tally, alpha: float, most: int
) -> list[int]:
    """Take one out and put the best one in, as long as that raises the objective."""
    counts = bits[chosen].sum(0, dtype=np.int32)
    now = tally.score_counts(counts, len(chosen), alpha).objective
    for _ in range(2):
        changed = False
        for member in list(chosen):
            without = counts - bits[member]
            alone = tally.score_counts(without, len(chosen) - 1, alpha).objective
            gains = tally.gains(weights, without, len(chosen) - 1, alpha, 1.0)
            gains[chosen] = -np.inf
            leader = int(np.argmax(gains))
            gain = max(float(gains[leader]), 0.0)
            if alone + gain <= now + 1e-6:
                continue
            chosen.remove(member)
            counts = without
            if gains[leader] > 0:
                chosen.append(leader)
                counts = counts + bits[leader]
            now = alone + gain
            changed = True
        if not changed:
            break
    return chosen


def prune(bits: np.ndarray, tally: Tally, alpha: float) -> list[int]:
    """Indices that remain after removing, one by one, the primitive whose absence raises the objective most."""
    kept = list(range(len(bits)))
    counts = bits.sum(0, dtype=np.int32)
    now = tally.score_counts(counts, len(kept), alpha).objective
    while len(kept) > 1:
        scores = [tally.score_counts(counts - bits[i], len(kept) - 1, alpha).objective for i in kept]
        best = int(np.argmax(scores))
        if scores[best] < now:
            break
        counts = counts - bits[kept[best]]
        now = scores[best]
        del kept[best]
    return kept
