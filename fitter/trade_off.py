"""How good an assembly is at every number of parts: cut down one by one, refined on the way."""

from __future__ import annotations

import numpy as np

from .chooser import Chooser
from .judge import Judge


def remove_down_to(values: np.ndarray, judge: Judge, count: int) -> list[int]:
    """Indices, ascending, of the `count` primitives left after removing the least missed one again and again.

    Args:
        values: distances (primitive_count, n) at the judge's samples.
        judge: the objective.
        count: how many are to be left.
    """
    choice = Chooser(values < 0, judge.tally, judge.alpha, judge.device)
    for index in range(len(values)):
        choice.add(index)
    while len(choice.chosen) > max(count, 0):
        choice.remove(choice.best_removal()[0])
    return sorted(choice.chosen)
