"""A growing choice among candidates, with what each further candidate would add kept up to date.

Works on bits (is this sample point inside that candidate), so the union is the hard one. Adding or removing a
candidate changes only the points inside it: the sums of all others are mended there instead of being taken anew.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from ..kernels.occupancy import CandidateBits
from .objective import Tally

ABSORBED = 0.75
"""Share of a member's points that a candidate which could stand for it holds."""


class Chooser:
    """The chosen candidates and the gains of all others."""

    def __init__(
        self, bits: np.ndarray, tally: Tally, alpha: float, device: wp.Device, false_volume: float = 1.0
    ):
        """`bits` (candidates, n) bool: which sample points each candidate holds."""
        self.tally, self.alpha, self.false_volume = tally, alpha, false_volume
        self.points = [np.flatnonzero(row) for row in bits]
        self.sizes = np.array([len(points) for points in self.points])
        self.bits = CandidateBits(bits, device)
        self.counts = np.zeros(bits.shape[1], np.int32)
        self.chosen: list[int] = []
        self.held = np.zeros(5)
        everywhere = np.arange(bits.shape[1])
        self.sums = self._weigh(everywhere, np.ones(len(everywhere)), everywhere[:0], np.zeros(0))

    def save(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[int]]:
        """What `restore` needs to come back to this choice."""
        return self.counts.copy(), self.held.copy(), self.sums.copy(), list(self.chosen)

    def restore(self, saved: tuple[np.ndarray, np.ndarray, np.ndarray, list[int]]) -> None:
        """Come back to a saved choice, which this one then owns."""
        self.counts, self.held, self.sums, self.chosen = saved

    def copy(self) -> Chooser:
        """An independent choice that goes on from here."""
        other = object.__new__(Chooser)
        other.__dict__.update(self.__dict__)
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
        return self.bits.weigh([*tasks, (once, once_by)]).astype(np.float64)

    def _change(self, index: int, step: int, mend_sums: bool = True) -> None:
        """Count the points of a candidate once more (step 1) or once less (-1), and mend all sums there.

        Without the sums it is much cheaper: enough for `score` and `best_removal`.
        """
        points = self.points[index]
        before = self.counts[points]
        after = before + step
        self.counts[points] = after
        freed = (after == 0).astype(np.int8) - (before == 0)
        twice = (after > 1).astype(np.int8) - (before > 1)
        changed = freed != 0
        self.held[:4] += step * self.tally.sums(points[changed])
        self.held[4] += (twice * self.tally.box[points]).sum()
        if mend_sums:
            once = (after == 1).astype(np.int8) - (before == 1)
            moved = (once != 0) & self.tally.box[points]
            self.sums += self._weigh(points[changed], freed[changed], points[moved], once[moved])

    def add(self, index: int) -> None:
        """Choose a candidate."""
        self._change(index, 1)
        self.chosen.append(index)

    def remove(self, index: int) -> None:
        """Take a chosen candidate out."""
        self._change(index, -1)
        self.chosen.remove(index)

    def score(self) -> float:
        """The objective of the choice as it is, with false volume weighed as asked for."""
        return float(self._objective(self.held, len(self.chosen)))

    def _objective(self, held: np.ndarray, primitive_count: int) -> np.ndarray:
        return self.tally.objective(held, primitive_count, self.alpha, self.false_volume)

    def gains(self) -> np.ndarray:
        """What each candidate would add to the objective, -inf for those chosen."""
        count = len(self.chosen)
        gains = self._objective(self.held + self.sums, count + 1) - self._objective(self.held, count)
        gains[self.chosen] = -np.inf
        return gains

    def likeness(self, index: int) -> np.ndarray:
        """Points that each candidate shares with this one, as a share of the points in either: (candidates,)."""
        points = self.points[index]
        common = self.bits.weigh([(points, np.ones(len(points)))])[:, 0]
        return common / np.maximum(self.sizes + len(points) - common, 1.0)

    def absorbs(self) -> np.ndarray:
        """Which members each candidate holds nearly all of: (candidates, members) bool, in the order of choice."""
        if not self.chosen:
            return np.zeros((len(self.points), 0), bool)
        tasks = [(self.points[member], np.ones(len(self.points[member]))) for member in self.chosen]
        return self.bits.weigh(tasks) > ABSORBED * np.maximum(self.sizes[self.chosen], 1)

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

    def best_removal(self, keep: int = -1) -> tuple[int, float]:
        """The member, other than `keep`, whose removal raises the objective most, and by how much."""
        now, count = self.score(), len(self.chosen)
        best, best_gain = -1, -np.inf
        for member in self.chosen:
            if member == keep:
                continue
            points = self.points[member]
            counts = self.counts[points]
            held = self.held.copy()
            held[:4] -= self.tally.sums(points[counts == 1])
            held[4] -= self.tally.box[points[counts == 2]].sum()
            gain = float(self._objective(held, count - 1)) - now
            if gain > best_gain:
                best, best_gain = member, gain
        return best, best_gain

    def score_swapped(self, newcomer: int, leavers: list[int]) -> float:
        """The objective with a candidate in the place of members; leaves the choice as it was."""
        counts, held = self.counts.copy(), self.held.copy()
        self._change(newcomer, 1, mend_sums=False)
        for leaver in leavers:
            self._change(leaver, -1, mend_sums=False)
        score = float(self._objective(self.held, len(self.chosen) + 1 - len(leavers)))
        self.counts, self.held = counts, held
        return score

    def replace_redundant(self, index: int) -> list[int] | None:
        """Members that a candidate makes redundant, if adding it and removing them raises the objective.

        Leaves the choice as it was.
        """
        before, members, held = self.score(), list(self.chosen), self.held.copy()
        self._change(index, 1, mend_sums=False)
        self.chosen.append(index)
        leavers: list[int] = []
        leaver, gain = self.best_removal(index)
        while gain > 0 and len(self.chosen) > 1:
            self._change(leaver, -1, mend_sums=False)
            self.chosen.remove(leaver)
            leavers.append(leaver)
            leaver, gain = self.best_removal(index)
        rose = self.score() > before + 1e-6
        for leaver in leavers:
            self._change(leaver, 1, mend_sums=False)
        self._change(index, -1, mend_sums=False)
        self.chosen, self.held = members, held
        return leavers if rose else None
