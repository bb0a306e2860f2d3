"""Merging: which candidate could stand for several parts of an assembly."""

from __future__ import annotations

import numpy as np

from ..kernels.rows import BLEND
from .assess import sorted_by_volume
from .chooser import Chooser
from .memory import CandidateMemory
from .workbench import Workbench

WORST_LOSS = 0.03
"""Objective that a merger may lose before it is refined."""


def mergers(rows: np.ndarray, memory: CandidateMemory, bench: Workbench, most: int) -> list[np.ndarray]:
    """The rows after each of the most promising mergers, unrefined, best first.

    Args:
        rows: (primitive_count, ROW), the parts.
        memory: the candidates that may stand for two of them or more.
        bench: the fit: its samples, price and device.
        most: mergers at most.
    """
    count = len(rows)
    if count < 2 or not memory.rows:
        return []
    pool = np.concatenate([rows, memory.candidates()])
    bits = np.concatenate([bench.inside(rows), memory.bits()])
    choice = Chooser(bits, bench.tally, bench.alpha, bench.device)
    for index in range(count):
        choice.add(index)
    absorbs = choice.absorbs()
    absorbs[:count] = False
    able = np.flatnonzero(absorbs.sum(1) > 1)
    scores = np.array(
        [choice.score_swapped(index, np.flatnonzero(absorbs[index]).tolist()) for index in able.tolist()]
    )
    moves = []
    for place in np.argsort(-scores, kind="stable")[:most]:
        if scores[place] < choice.score() - WORST_LOSS:
            break
        index = able[place]
        leavers = np.flatnonzero(absorbs[index])
        pool[index, BLEND] = rows[leavers, BLEND].max()
        kept = [member for member in range(count) if member not in leavers]
        moves.append(pool[sorted_by_volume(pool, [*kept, int(index)])])
    return moves
