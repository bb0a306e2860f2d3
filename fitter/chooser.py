"""A growing choice among candidates, with what each further candidate would add kept up to date.

Works on bits (is this sample point inside that candidate), so the union is the hard one. Adding or removing a
candidate changes only the points inside it: the sums of all others are mended there instead of being taken anew.
"""

from __future__ import annotations

import numpy as np

from ..kernels.occupancy import Holdings
from .cover import Cover
from .objective import Tally

ABSORBED = 0.75
"""Share of a member's points that a candidate which could stand for it holds."""


class Chooser(Cover):
    """The chosen candidates and the gains of all others."""

    def __init__(self, holdings: Holdings, tally: Tally, alpha: float, false_volume: float = 1.0):
        super().__init__(holdings, tally, alpha, false_volume)
        # With nothing chosen, a candidate adds just what would be missing if it alone were there.
        self.counts.fill(1)
        self.sums = self.removals.of(range(holdings.count))
        self.counts.fill(0)

    def save(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[int]]:
        """What `restore` needs to come back to this choice."""
        return self.counts.copy(), self.held.copy(), self.sums.copy(), list(self.chosen)

    def restore(self, saved: tuple[np.ndarray, np.ndarray, np.ndarray, list[int]]) -> None:
        """Come back to a saved choice, which this one then owns."""
        counts, self.held, self.sums, self.chosen = saved
        self.counts[:] = counts

    def copy(self) -> Chooser:
        """An independent choice that goes on from here."""
        other = object.__new__(Chooser)
        other.__dict__.update(self.__dict__)
        other._begin_counts()
        other.restore(self.save())
        return other

    def _weigh(
        self, freed: np.ndarray, freed_by: np.ndarray, once: np.ndarray, once_by: np.ndarray
    ) -> np.ndarray:
        """Sums (candidates, 5) over points that become free to cover, and that become covered just once."""
        kind = self.tally.kind[freed]
        weights = freed_by * self.tally.weight[freed]
        tasks = [(freed[kind == number], weights[kind == number]) for number in range(4)]
        once_by = once_by * self.tally.box[once]
        return self.holdings.weigh([*tasks, (once, once_by)]).astype(np.float64)

    def gains(self) -> np.ndarray:
        """What each candidate would add to the objective, -inf for those chosen."""
        count = len(self.chosen)
        gains = self._objective(self.held + self.sums, count + 1) - self._objective(self.held, count)
        gains[self.chosen] = -np.inf
        return gains

    def likeness(self, index: int) -> np.ndarray:
        """Points that each candidate shares with this one, as a share of the points in either: (candidates,)."""
        points = self.holdings.lists[index]
        common = self.holdings.weigh([(points, np.ones(len(points)))])[:, 0]
        return common / np.maximum(self.holdings.sizes + len(points) - common, 1.0)

    def absorbs(self) -> np.ndarray:
        """Which members each candidate holds nearly all of: (candidates, members) bool, in the order of choice."""
        if not self.chosen:
            return np.zeros((len(self.holdings.lists), 0), bool)
        lists = self.holdings.lists
        tasks = [(lists[member], np.ones(len(lists[member]))) for member in self.chosen]
        return self.holdings.weigh(tasks) > ABSORBED * np.maximum(self.holdings.sizes[self.chosen], 1)

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

    def _mend(self, index: int, step: int, before: np.ndarray, after: np.ndarray) -> None:
        """Mend the sums of all candidates where a change of the counts frees a point, or leaves one holder."""
        points = self.holdings.lists[index]
        freed = (after == 0).astype(np.int8) - (before == 0)
        once = (after == 1).astype(np.int8) - (before == 1)
        changed, moved = freed != 0, (once != 0) & self.tally.box[points]
        self.sums += self._weigh(points[changed], freed[changed], points[moved], once[moved])
