"""Merging: which candidate could stand for several parts of an assembly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...kernels.rows import BLEND
from ..objective.objective import Tally
from ..objective.scoring import sorted_by_volume
from ..propose.candidate_pool import CandidatePool
from ..select.greedy_cover import GreedyCover

WORST_LOSS = 0.03
"""Objective that a merger may lose before it is refined."""


def mergers(
    rows: np.ndarray,
    candidate_pool: CandidatePool,
    family: str,
    tally: Tally,
    alpha: float,
    most: int,
    worst_loss: float = WORST_LOSS,
) -> list[np.ndarray]:
    """The rows after each of the most promising mergers, unrefined, best first.

    Args:
        rows: (primitive_count, ROW), the parts.
        candidate_pool: the candidates that may stand for two of them or more.
        family: of all primitives.
        tally: the objective's sums.
        alpha: price of a primitive.
        most: mergers at most.
        worst_loss: objective that one may lose before it is refined.
    """
    count = len(rows)
    if count < 2 or not candidate_pool.rows:
        return []
    pool = np.concatenate([candidate_pool.candidates(), rows])
    members = list(range(len(pool) - count, len(pool)))
    with candidate_pool.joined_by(rows) as coverage:
        choice = GreedyCover(coverage, tally, alpha)
        return _mergers(choice, pool, [family] * len(pool), members, most, worst_loss)


def _mergers(
    choice: GreedyCover,
    pool: np.ndarray,
    families: Sequence[str],
    members: list[int],
    most: int,
    worst_loss: float,
) -> list[np.ndarray]:
    """`mergers` of the members of a pool."""
    for index in members:
        choice.add(index)
    absorbs = choice.absorbs()
    absorbs[members] = False
    able = np.flatnonzero(absorbs.sum(1) > 1)
    scores = np.array(
        [choice.score_swapped(index, _absorbed(members, absorbs[index])) for index in able.tolist()]
    )
    moves = []
    for place in np.argsort(-scores, kind="stable")[:most]:
        if scores[place] < choice.score() - worst_loss:
            break
        index = able[place]
        leavers = _absorbed(members, absorbs[index])
        merged = pool.copy()
        merged[index, BLEND] = pool[leavers, BLEND].max()
        kept = [member for member in members if member not in leavers]
        moves.append(merged[sorted_by_volume(merged, families, [*kept, int(index)])])
    return moves


def _absorbed(members: list[int], absorbed: np.ndarray) -> list[int]:
    """The members (in the order of choice) that a candidate absorbs."""
    return [member for member, held in zip(members, absorbed, strict=True) if held]
