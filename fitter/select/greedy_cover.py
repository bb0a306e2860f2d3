"""A growing choice among candidates, with what each further candidate would add kept up to date.

Works on bits (is this sample point inside that candidate), so the union is the hard one. Adding or removing a
candidate changes only the points inside it: the sums of all others are mended there instead of being taken anew.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...kernels.select.coverage_gains import MarginalGains
from ...kernels.select.coverage_sets import CandidateCoverage
from ...kernels.select.swap_moves import replace_members
from ..objective.objective import Tally
from .cover import Cover

ABSORBED = 0.75
"""Share of a member's points that a candidate which could stand for it holds."""


MOSTLY_AIR = 4.0
"""Air per solid, among the points of the box, above which a candidate is none: refinement makes rough ones precise."""

LEAST_AIR = 4.0
"""Sample points by which there must be more air: fewer are chance."""


class GreedyCover(Cover):
    """The chosen candidates and the gains of all others."""

    def __init__(self, coverage: CandidateCoverage, tally: Tally, alpha: float, false_volume: float = 1.0):
        super().__init__(coverage, tally, alpha, false_volume)
        self.additions = MarginalGains(self.counts)
        self.airy = _hold_more_air(self.additions.of_all())
        self._common: dict[int, np.ndarray] = {}

    def save(self) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray, list[int]]:
        """Checkpoint of this choice, for `restore`."""
        return self.counts.save(), self.additions.save(), list(self.chosen)

    def restore(self, saved: tuple[tuple[np.ndarray, np.ndarray], np.ndarray, list[int]]) -> None:
        """Come back to a saved choice."""
        counts, additions, chosen = saved
        self.counts.restore(counts)
        self.additions.restore(additions)
        self.chosen = list(chosen)

    def copy(self) -> GreedyCover:
        """An independent choice that goes on from here."""
        other = GreedyCover(self.coverage, self.tally, self.alpha, self.false_volume)
        other.restore(self.save())
        return other

    def add(self, index: int) -> None:
        """Choose a candidate."""
        super().add(index)
        self.additions.update()

    def remove(self, index: int) -> None:
        """Take a chosen candidate out."""
        super().remove(index)
        self.additions.update()

    def gains(self) -> np.ndarray:
        """Marginal gain in the objective of each candidate, -inf for those chosen."""
        held, count = self.held + self.additions.of_all(), len(self.chosen)
        gains = self._objective(held, count + 1) - self.score()
        gains[self.chosen] = -np.inf
        gains[self.airy] = -np.inf
        return gains

    def _common_with(self, members: Sequence[int]) -> list[np.ndarray]:
        """Points that each member shares with each candidate: (candidates,) int32 each."""
        new = [member for member in members if member not in self._common]
        if new:
            self._common.update(zip(new, self.coverage.common(new), strict=True))
        return [self._common[member] for member in members]

    def likeness(self, index: int) -> np.ndarray:
        """Points that each candidate shares with a member, as a share of the points in either: (candidates,)."""
        common = self._common_with(self.chosen)[self.chosen.index(index)]
        sizes = self.coverage.sizes
        return common / np.maximum(sizes + sizes[index] - common, 1)

    def absorbs(self) -> np.ndarray:
        """Near-containment of members in candidates: (candidates, members) bool, in the order of choice."""
        absorbed = np.zeros((self.coverage.count, len(self.chosen)), bool)
        for place, (member, common) in enumerate(
            zip(self.chosen, self._common_with(self.chosen), strict=True)
        ):
            absorbed[:, place] = common > ABSORBED * max(1, self.coverage.sizes[member])
        return absorbed

    def best_addition(self, barred: np.ndarray | None = None) -> tuple[int, float]:
        """The candidate that raises the objective most, and by how much; (-1, -inf) where none is left.

        Candidates that are `barred` (candidates,) do not count.
        """
        gains = self.gains()
        if barred is not None:
            gains[barred] = -np.inf
        if not len(gains):
            return -1, -np.inf
        leader = int(np.argmax(gains))
        return leader, float(gains[leader])

    def score_swapped(self, newcomer: int, leavers: list[int]) -> float:
        """The objective with a candidate in the place of members; leaves the choice as it was."""
        saved = self.counts.save()
        self.counts.count(newcomer, 1)
        for leaver in leavers:
            self.counts.count(leaver, -1)
        score = float(self._objective(self.held, len(self.chosen) + 1 - len(leavers)))
        self.counts.restore(saved)
        return score

    def replace_redundant(self, newcomers: Sequence[int]) -> list[list[int] | None]:
        """For each candidate the members that it makes redundant, if adding it and removing them raises the objective.

        Leaves the choice as it was.
        """
        scores, leavers = replace_members(self.counts, newcomers, self.chosen, self.prices)
        rose = scores > self.score() + 1e-6
        return [leave if better else None for leave, better in zip(leavers, rose, strict=True)]


def _hold_more_air(sums: np.ndarray) -> np.ndarray:
    """Mask of candidates (k,) that hold far more outside the target than in it, by their sums (k, 5).

    Where everything else is poor even such a one raises an IoU: a slab across a filigree, which then explains all of it
    and leaves nothing to decompose.
    """
    _, _, solid, air, _ = sums.T
    return air > MOSTLY_AIR * solid + LEAST_AIR
