"""Cover of the sample points: chosen candidates, how often they hold each point, and the objective of it."""

from __future__ import annotations

import numpy as np

from ...kernels.select.coverage_gains import CoverageCounts
from ...kernels.select.coverage_sets import CandidateCoverage
from ...kernels.select.objective_sums import Sums, objective
from ..objective.objective import SEARCH_OVERLAP_PRICE, Tally


class Cover:
    """A choice of candidates: additions, removals and its score, for the hard union."""

    def __init__(self, coverage: CandidateCoverage, tally: Tally, alpha: float, false_volume: float = 1.0):
        """`coverage` says which sample points each candidate holds; it must not change while this is in use."""
        self.tally, self.alpha, self.false_volume = tally, alpha, false_volume
        self.prices = tally.prices(alpha, SEARCH_OVERLAP_PRICE, false_volume=false_volume)
        self.coverage = coverage
        self.chosen: list[int] = []
        self.counts = CoverageCounts(coverage, tally.kind, tally.weight)

    @property
    def held(self) -> np.ndarray:
        """Sums (HARD_SUMS,) of what the choice holds."""
        return self.counts.held.host

    def add(self, index: int) -> None:
        """Choose a candidate."""
        self.counts.count(index, 1)
        self.chosen.append(index)

    def remove(self, index: int) -> None:
        """Take a chosen candidate out."""
        self.counts.count(index, -1)
        self.chosen.remove(index)

    def score(self) -> float:
        """The objective of the choice as it is, with false volume weighed as asked for."""
        return float(self._objective(self.held, len(self.chosen)))

    def _objective(self, held: np.ndarray, primitive_count: int) -> np.ndarray:
        return objective(Sums(*held.T), primitive_count, self.prices)

    def best_removal(self) -> tuple[int, float]:
        """The member whose removal raises the objective most, and by how much."""
        gains = self.removal_gains()
        best = int(np.argmax(gains))
        return self.chosen[best], float(gains[best])

    def alone(self) -> np.ndarray:
        """Weight of the points that each member alone holds, (members, 2): in the target and outside it."""
        near_in, near_out, box_in, box_out, _ = self.counts.removals(self.chosen).T
        return np.stack([near_in + box_in, near_out + box_out], axis=1)

    def removal_gains(self) -> np.ndarray:
        """By how much the objective rises without each member, (members,), in the order of choice."""
        left = self.held - self.counts.removals(self.chosen)
        return self._objective(left, len(self.chosen) - 1) - self.score()
