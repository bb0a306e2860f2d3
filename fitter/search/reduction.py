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
from ...kernels.runtime.launch import serial_device
from ...kernels.select.coverage_sets import hold
from ...shape.target import Target
from ..config import FitConfig, RefineConfig
from ..objective.cached import CachedObjective
from ..propose.split_merge import neighbour_pairs, part_regions
from ..refine.joint import refine
from ..select.cover import Cover
from .merge import mergers
from .multi_start import MultiStart
from .search import SATURATION

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


class Reduction(MultiStart):
    """An assembly that gets fewer parts."""

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
        super().__init__(target, replace(config, timeout=0.0), device, None, should_stop)
        self.slabs = True
        if not self.should_stop():
            # Rounds propose what is unexplained: few large parts must come from the whole.
            self.propose(largest_parts(self.find_parts(True), config.propose.regions), 0)
        self.take(rows)

    def values(self, rows: np.ndarray) -> np.ndarray:
        """Distances (primitive_count, n) at the samples; only rows not seen of late cost."""
        return self.cached_objective.values(rows)

    def take(self, rows: np.ndarray) -> None:
        """Go on from rows."""
        self.rows, self.score = rows, self.assess(rows)

    def step(self) -> None:
        """One part less, or several where one can stand for them."""
        moves = self.removals(REMOVALS)
        if not self.should_stop():
            parts = self.parts()
            pairs = neighbour_pairs(parts)[: self.config.propose.merges]
            self.propose(part_regions(parts, pairs, "pair"), len(self.rows))
            moves += mergers(self.rows, self.candidate_pool, self, MERGERS, np.inf)
            moves.sort(key=lambda move: -self.assess(move).objective)
            moves += [
                refine(move, self.families(move), self.samples, STEPS, self.device, self.should_stop)
                for move in moves[:REFINED]
            ]
        self.take(max(moves, key=lambda move: self.assess(move).objective))

    def removals(self, most: int) -> list[np.ndarray]:
        """The rows without one of those that are missed least, that first."""
        choice = Cover(hold(self.values(self.rows) < 0, serial_device()), self.tally, self.alpha)
        for index in range(len(self.rows)):
            choice.add(index)
        order = np.argsort(-choice.removal_gains(), kind="stable")
        return [np.delete(self.rows, index, 0) for index in order[:most]]

    def improved(self, count: int) -> np.ndarray:
        """The best found of at most `count` parts, (primitive_count, ROW), from the rows of the moment, which stay.

        Rounds go on from them, begin from nothing, and put both ends together.
        """
        rows, config, candidate_pool = self.rows, self.config, self.candidate_pool
        self.config, self.candidate_pool = replace(config, max_primitives=count), candidate_pool.copy()
        self.exchange(rows)
        if len(rows) <= FEW:
            ends = [self.rows]
            self.exchange(rows[:0])
            ends.append(self.rows)
            self.exchange(max(ends, key=lambda end: self.assess(end).objective), np.concatenate(ends))
        best = self.rows
        self.config, self.candidate_pool = config, candidate_pool
        self.take(rows)
        return best

    def exchange(self, rows: np.ndarray, others: np.ndarray | None = None) -> None:
        """Rounds from `rows` until one no longer pays, and a polish; `others` are further candidates of the first."""
        self.take(rows)
        self.field = None
        if len(rows):
            self.look()
        for number in range(MOST_ROUNDS if len(rows) <= FEW else 0):
            before = self.score.objective
            if not self.should_stop():
                self.round(number, None, others if not number else None)
            if self.score.objective < before + SATURATION:
                break
        if not self.should_stop():
            self.polish()
