"""Which candidates are chosen, how often they hold each sample point, and what the objective makes of it."""

from __future__ import annotations

import numpy as np

from ..kernels.occupancy import Holdings, RemovalSums
from .objective import Tally


class Cover:
    """A choice of candidates: additions, removals and its score, for the hard union."""

    def __init__(self, holdings: Holdings, tally: Tally, alpha: float, false_volume: float = 1.0):
        """`holdings` says which sample points each candidate holds; it must not change while this is in use."""
        self.tally, self.alpha, self.false_volume = tally, alpha, false_volume
        self.holdings = holdings
        self.chosen: list[int] = []
        self.held = np.zeros(5)
        self._begin_counts()

    def _begin_counts(self) -> None:
        """Counts of this choice's own, all 0."""
        self.counts = np.zeros(self.holdings.point_count, np.int32)
        self.removals = RemovalSums(self.holdings, self.counts, self.tally.kind, self.tally.weight)

    def _count(self, index: int, step: int) -> tuple[np.ndarray, np.ndarray]:
        """Count the points of a candidate once more (step 1) or once less (-1): their counts before and after."""
        points = self.holdings.lists[index]
        before = self.counts[points]
        after = before + step
        self.counts[points] = after
        # Points that begin or cease to be covered, and to be covered twice.
        lower = before if step > 0 else after
        self.held[:4] += step * self.tally.sums(points[lower == 0])
        self.held[4] += step * np.count_nonzero(self.tally.box[points[lower == 1]])
        return before, after

    def _mend(self, index: int, step: int, before: np.ndarray, after: np.ndarray) -> None:
        """Called after every addition and removal with the counts at the candidate's points."""

    def add(self, index: int) -> None:
        """Choose a candidate."""
        self._mend(index, 1, *self._count(index, 1))
        self.chosen.append(index)

    def remove(self, index: int) -> None:
        """Take a chosen candidate out."""
        self._mend(index, -1, *self._count(index, -1))
        self.chosen.remove(index)

    def score(self) -> float:
        """The objective of the choice as it is, with false volume weighed as asked for."""
        return float(self._objective(self.held, len(self.chosen)))

    def _objective(self, held: np.ndarray, primitive_count: int) -> np.ndarray:
        return self.tally.objective(held, primitive_count, self.alpha, self.false_volume)

    def best_removal(self, keep: int = -1) -> tuple[int, float]:
        """The member, other than `keep`, whose removal raises the objective most, and by how much."""
        members = [member for member in self.chosen if member != keep]
        if not members:
            return -1, -np.inf
        left = self.held - self.removals.of(members)
        gains = self._objective(left, len(self.chosen) - 1) - self.score()
        best = int(np.argmax(gains))
        return members[best], float(gains[best])

    def score_swapped(self, newcomer: int, leavers: list[int]) -> float:
        """The objective with a candidate in the place of members; leaves the choice as it was."""
        counts, held = self.counts.copy(), self.held.copy()
        self._count(newcomer, 1)
        for leaver in leavers:
            self._count(leaver, -1)
        score = float(self._objective(self.held, len(self.chosen) + 1 - len(leavers)))
        self.counts[:], self.held = counts, held
        return score

    def replace_redundant(self, index: int) -> list[int] | None:
        """Members that a candidate makes redundant, if adding it and removing them raises the objective.

        Leaves the choice as it was.
        """
        before, members, held = self.score(), list(self.chosen), self.held.copy()
        self._count(index, 1)
        self.chosen.append(index)
        leavers: list[int] = []
        leaver, gain = self.best_removal(index)
        while gain > 0 and len(self.chosen) > 1:
            self._count(leaver, -1)
            self.chosen.remove(leaver)
            leavers.append(leaver)
            leaver, gain = self.best_removal(index)
        rose = self.score() > before + 1e-6
        for leaver in leavers:
            self._count(leaver, 1)
        self._count(index, -1)
        self.chosen, self.held = members, held
        return leavers if rose else None
