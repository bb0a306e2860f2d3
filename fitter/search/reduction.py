"""Reduction: the best assembly of fewer parts, found from a richer one.

Parts are removed or merged one after another, whichever is missed least once all others have moved. With as few as are
wanted, rounds go on as in a fit: parts are exchanged for others that explain more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import warp as wp

from ...decomposition.propose import largest_parts
from ...decomposition.region import Region
from ...kernels.runtime.launch import serial_device
from ...kernels.select.coverage_sets import hold
from ...shape.target import Target
from ..config import FitConfig, RefineConfig
from ..objective.cached import CachedObjective
from ..objective.objective import Score
from ..propose.split_merge import neighbour_pairs, part_regions
from ..refine.joint import refine
from ..select.cover import Cover
from .assess import assess, begin_search, evaluate_field
from .context import search_context
from .finish import polish
from .merge import mergers
from .proposals import proposals_of, unexplained_parts
from .track import SATURATION, run_round

REMOVALS, MERGERS = 2, 3
"""Ways to do with one part less that are looked at."""

REFINED = 3
"""The best of them are refined before they are judged."""

STEPS = RefineConfig(iterations=8, betas=(80.0, 200.0))
"""That refinement."""

MOST_ROUNDS = 4
"""From each beginning, with the wanted number of parts."""

FEW = 16
"""With more parts than this no rounds follow: what the fit did with even more of them is not bettered so."""


class Reduction:
    """An assembly that gets fewer parts.

    Attributes:
        cached_objective: what its assemblies are judged by.
    """

    def __init__(
        self,
        rows: np.ndarray,
        target: Target,
        config: FitConfig,
        device: wp.Device,
        should_stop: Callable[[], bool] = lambda: False,
    ):
        """Begin with `rows`, (primitive_count, ROW), fitted to the target; there is no time-out but `should_stop`."""
        self.cached_objective = CachedObjective(target, config, device)
        self._context = search_context(target, replace(config, timeout=0.0), device, None, should_stop)
        self._state = begin_search(self._context)
        self._state.distances = self.cached_objective.distances
        if not self._context.should_stop():
            # Rounds propose what is unexplained: few large parts must come from the whole.
            parts = unexplained_parts(self._context, self._state, slabs=True)
            self._propose(largest_parts(parts, config.propose.regions), 0)
        self._take(rows)

    @property
    def rows(self) -> np.ndarray:
        """The assembly of the moment, (primitive_count, ROW)."""
        return self._state.rows

    def step(self) -> None:
        """One part less, or several where one can stand for them."""
        context, state = self._context, self._state
        moves = self._removals(REMOVALS)
        if not context.should_stop():
            parts = context.parts(state.rows)
            pairs = neighbour_pairs(parts)[: context.config.propose.merges]
            self._propose(part_regions(parts, pairs, "pair"), len(state.rows))
            moves += mergers(
                state.rows,
                state.candidate_pool,
                context.config.primitive,
                context.tally,
                state.alpha,
                MERGERS,
                np.inf,
            )
            moves.sort(key=lambda move: -self._assess(move).objective)
            moves += [
                refine(
                    move, context.families(move), context.samples, STEPS, context.device, context.should_stop
                )
                for move in moves[:REFINED]
            ]
        self._take(max(moves, key=lambda move: self._assess(move).objective))

    def improved(self, count: int) -> np.ndarray:
        """The best found of at most `count` parts, (primitive_count, ROW), from the rows of the moment, which stay.

        Rounds go on from them, begin from nothing, and put both ends together.
        """
        state, context = self._state, self._context
        rows, candidate_pool = state.rows, state.candidate_pool
        self._context = replace(context, config=replace(context.config, max_primitives=count))
        state.candidate_pool = candidate_pool.copy()
        self._exchange(rows)
        if len(rows) <= FEW:
            ends = [state.rows]
            self._exchange(rows[:0])
            ends.append(state.rows)
            self._exchange(max(ends, key=lambda end: self._assess(end).objective), np.concatenate(ends))
        best = state.rows
        self._context, state.candidate_pool = context, candidate_pool
        self._take(rows)
        return best

    def _exchange(self, rows: np.ndarray, others: np.ndarray | None = None) -> None:
        """Rounds from `rows` until one no longer pays, and a polish; `others` are further candidates of the first."""
        context, state = self._context, self._state
        self._take(rows)
        state.grid_field = None
        if len(rows):
            evaluate_field(context, state)
        for number in range(MOST_ROUNDS if len(rows) <= FEW else 0):
            before = state.score.objective
            if not context.should_stop():
                run_round(context, state, number, None, others if not number else None)
            if state.score.objective < before + SATURATION:
                break
        if not context.should_stop():
            polish(context, state)

    def _assess(self, rows: np.ndarray) -> Score:
        """The objective of rows."""
        return assess(self._context, self._state, rows)

    def _take(self, rows: np.ndarray) -> None:
        """Go on from rows."""
        self._state.rows, self._state.score = rows, self._assess(rows)

    def _propose(self, regions: list[Region], number: int) -> None:
        """Put candidates for regions on offer."""
        proposals_of(self._context).candidates(self._context, self._state, regions, number)

    def _removals(self, most: int) -> list[np.ndarray]:
        """The rows without one of those that are missed least, that first."""
        rows, distances = self.rows, self._state.distances
        choice = Cover(
            hold(distances.values(rows) < 0, serial_device()), self._context.tally, self._state.alpha
        )
        for index in range(len(rows)):
            choice.add(index)
        order = np.argsort(-choice.removal_gains(), kind="stable")
        return [np.delete(rows, index, 0) for index in order[:most]]
