"""How good an assembly is at every number of parts: cut down one by one, refined on the way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..kernels.launch import serial_device
from ..kernels.occupancy import hold
from .config import FitConfig
from .cover import Cover
from .judge import Judge
from .objective import Score
from .refine import refine

RICH_SHARE = 0.25
"""Price of a primitive in the fit that a curve begins with, as a share of the full one: it ends with more parts."""

REFINE_STEPS = 8
"""Levenberg steps after a removal."""

FEW = 24
"""With no more parts than this, each removal is followed by a refinement; with more, one in as many as FEW fit in."""


@dataclass(frozen=True)
class Cut:
    """An assembly of so many parts."""

    kept: tuple[int, ...]
    """Indices of its parts in the richest assembly, ascending."""
    rows: np.ndarray
    """(primitive_count, ROW) float32."""
    score: Score
    """The objective at the full price."""


def cut_down(
    rows: np.ndarray, judge: Judge, config: FitConfig, should_stop: Callable[[], bool] = lambda: False
) -> list[Cut]:
    """Assemblies of every number of parts from all to one, the richest first.

    Args:
        rows: (primitive_count, ROW), the richest assembly.
        judge: the objective; the part whose loss costs least goes first.
        config: of the fit.
        should_stop: asked before each removal; once True, the rest is cut without refinement.
    """
    steps = replace(config.refine, iterations=REFINE_STEPS, betas=(80.0, 200.0))
    kept = list(range(len(rows)))
    cuts = [Cut(tuple(kept), rows, judge.score(rows))]
    while len(kept) > 1:
        left = remove_down_to(judge.values(rows), judge, len(kept) - 1)
        kept, rows = [kept[index] for index in left], rows[left]
        score = judge.score(rows)
        due = len(kept) % max(1, -(-len(kept) // FEW)) == 0
        if due and config.optimizer == "levenberg" and not should_stop():
            moved = refine(rows, judge.families(rows), judge.samples, steps, judge.device, should_stop)
            found = judge.score(moved)
            if found.objective > score.objective:
                rows, score = moved, found
        cuts.append(Cut(tuple(kept), rows, score))
    return cuts


def remove_down_to(values: np.ndarray, judge: Judge, count: int) -> list[int]:
    """Indices, ascending, of the `count` primitives left after removing the least missed one again and again.

    Args:
        values: distances (primitive_count, n) at the judge's samples.
        judge: the objective.
        count: how many are to be left.
    """
    choice = Cover(hold(values < 0, serial_device()), judge.tally, judge.alpha)
    for index in range(len(values)):
        choice.add(index)
    while len(choice.chosen) > max(count, 0):
        choice.remove(choice.best_removal()[0])
    return sorted(choice.chosen)
