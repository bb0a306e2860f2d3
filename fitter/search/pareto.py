"""Pareto front over the number of parts: at each, the best known assembly with at most so many."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from ...kernels.runtime.launch import serial_device
from ...kernels.select.coverage_sets import hold
from ..config import FitConfig
from ..objective.cached import CachedObjective
from ..objective.objective import Score, at_price
from ..refine.joint import refine
from ..refine.refiner import REFINERS
from ..regularise.standard_form import standard_forms
from ..select.cover import Cover
from .reduction import Reduction

RICH_SHARE = 0.25
"""Price of a primitive in the fit of more parts than pay, as a share of the full one."""

REFINE_STEPS = 8
"""Levenberg steps after a removal."""

FEW = 24
"""With no more parts than this, each removal is followed by a refinement; with more, one in as many as FEW fit in."""


@dataclass(frozen=True)
class Cut:
    """An assembly of so many parts."""

    places: tuple[int, ...]
    """The part of the fit's own assembly that each of its parts stands for; numbers beyond those for others."""
    rows: np.ndarray
    """(primitive_count, ROW) float32."""
    score: Score
    """The objective at the full price."""
    worth: float
    """The objective without the price of parts."""
    chosen: bool
    """Whether it is the fit's own assembly."""


def trade_off(
    chosen: np.ndarray, others: Iterable[np.ndarray], cached_objective: CachedObjective, most: int
) -> list[Cut]:
    """The best known assemblies of each number of parts, the fewest first: more parts are always worth more.

    Without the price of parts, that is. Where fewer parts are worth as much, a number has none.

    Args:
        chosen: (primitive_count, ROW), the fit's own assembly, which is one of them.
        others: rows of further ones.
        cached_objective: the objective.
        most: parts at most.
    """

    def worth(rows: np.ndarray) -> float:
        return at_price(cached_objective.score(rows), 0.0, cached_objective.alpha).objective

    best: dict[int, np.ndarray] = {}
    for rows in others:
        rows = standard_forms(rows, cached_objective, [])
        count = len(rows)
        if 0 < count <= most and (count not in best or worth(rows) > worth(best[count])):
            best[count] = rows
    best[len(chosen)] = chosen
    cuts: list[Cut] = []
    for count in rising([(count, worth(best[count])) for count in sorted(best)], len(chosen)):
        rows = best[count]
        places = places_in(chosen, rows, cached_objective)
        cuts.append(Cut(places, rows, cached_objective.score(rows), worth(rows), rows is chosen))
    return cuts


def rising(points: Sequence[tuple[int, float]], chosen: int) -> list[int]:
    """The counts whose values never fall, of (count, value) by rising count; the chosen count is always one of them."""
    limit, top, kept = dict(points)[chosen], -np.inf, []
    for count, value in points:
        if top < value <= (limit if count < chosen else np.inf) or count == chosen:
            kept.append(count)
            top = value
    return kept


def places_in(reference: np.ndarray, rows: np.ndarray, cached_objective: CachedObjective) -> tuple[int, ...]:
    """The part of `reference` that each of the rows stands for, by what they hold; a number beyond for others."""
    held, known = cached_objective.values(rows) < 0, cached_objective.values(reference) < 0
    common = np.array([(known & own).sum(1) for own in held])
    places = np.full(len(rows), -1)
    for row, place in zip(*linear_sum_assignment(-common), strict=True):
        if common[row, place] > 0:
            places[row] = place
    rest = np.flatnonzero(places < 0)
    places[rest] = len(reference) + np.arange(len(rest))
    return tuple(places.tolist())


def reductions(fit: Reduction) -> Iterator[np.ndarray]:
    """The best found of each number of parts below that of a fit: what it comes to if so many are allowed."""
    while len(fit.rows) > 1:
        fit.step()
        yield fit.improved(len(fit.rows))


def cut_down(
    rows: np.ndarray,
    cached_objective: CachedObjective,
    config: FitConfig,
    should_stop: Callable[[], bool] = lambda: False,
) -> Iterator[np.ndarray]:
    """Assemblies of every number of parts from all to one, refined on the way.

    Args:
        rows: (primitive_count, ROW), the richest assembly.
        cached_objective: the objective; the part whose loss costs least goes first.
        config: of the fit.
        should_stop: asked before each removal; once True, the rest is cut without refinement.
    """
    steps = replace(config.refine, iterations=REFINE_STEPS, betas=(80.0, 200.0))
    yield rows
    while len(rows) > 1:
        rows = rows[remove_down_to(cached_objective.values(rows), cached_objective, len(rows) - 1)]
        due = len(rows) % max(1, -(-len(rows) // FEW)) == 0
        if due and not REFINERS[config.optimizer].selects and not should_stop():
            moved = refine(
                rows,
                cached_objective.families(rows),
                cached_objective.samples,
                steps,
                cached_objective.device,
                should_stop,
            )
            rows = max(rows, moved, key=cached_objective.objective)
        yield rows


def remove_down_to(values: np.ndarray, cached_objective: CachedObjective, count: int) -> list[int]:
    """Indices, ascending, of the `count` primitives left after removing the least missed one again and again.

    Args:
        values: distances (primitive_count, n) at the judge's samples.
        cached_objective: the objective.
        count: how many are to be left.
    """
    choice = Cover(hold(values < 0, serial_device()), cached_objective.tally, cached_objective.alpha)
    for index in range(len(values)):
        choice.add(index)
    while len(choice.chosen) > max(count, 0):
        choice.remove(choice.best_removal()[0])
    return sorted(choice.chosen)
