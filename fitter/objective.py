"""The objective O = R - alpha n - 0.03 overlap on fixed sample points (metrics.md), and its counts.

R is the mean of two IoUs: on points near the surface, weighted by curvature, and on uniform points of the box.
Selection and pruning work on bits (is this point inside that primitive), so the union is the hard one there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

OVERLAP_PRICE = 0.03
"""Objective lost to a share of the volume that lies in more than one primitive."""


@dataclass(frozen=True)
class ObjectiveSamples:
    """Points near the surface first, then points of the box."""

    points: np.ndarray
    """(n, 3) float32, normalised frame."""
    distance: np.ndarray
    """(n,) float32 exact signed distance of the target."""
    weight: np.ndarray
    """(n,) float32; 1 for points of the box."""
    near_count: int

    @property
    def inside(self) -> np.ndarray:
        """(n,) bool: in the target."""
        return self.distance < 0


@dataclass(frozen=True)
class Score:
    """The objective's parts."""

    near_iou: float
    volume_iou: float
    overlap: float
    primitive_count: int
    objective: float

    @property
    def recovery(self) -> float:
        """R, without the price of primitives and overlap."""
        return 0.5 * (self.near_iou + self.volume_iou)


class Tally:
    """Weights of the samples by column: near inside, near outside, box inside, box outside (curvature included)."""

    def __init__(self, samples: ObjectiveSamples):
        near = np.arange(len(samples.points)) < samples.near_count
        inside = samples.inside
        columns = np.stack([near & inside, near & ~inside, ~near & inside, ~near & ~inside], axis=1)
        self.columns = columns * samples.weight[:, None].astype(np.float32)
        self.box = (~near).astype(np.float32)
        self.near_total, _, self.box_total, _ = self.columns.sum(0, dtype=np.float64)

    def score(self, covered: np.ndarray, twice: np.ndarray, primitive_count: int, alpha: float) -> Score:
        """The objective of an assembly.

        Args:
            covered: (n,) bool, in the union.
            twice: (n,) bool, in two primitives or more.
            primitive_count: of the assembly.
            alpha: price of a primitive.
        """
        near_in, near_out, box_in, box_out = covered.astype(np.float32) @ self.columns
        near_iou = float(near_in / max(self.near_total + near_out, 1e-9))
        volume_iou = float(box_in / max(self.box_total + box_out, 1e-9))
        overlap = float((twice * self.box).sum() / max((covered * self.box).sum(), 1.0))
        objective = 0.5 * (near_iou + volume_iou) - alpha * primitive_count - OVERLAP_PRICE * overlap
        return Score(near_iou, volume_iou, overlap, primitive_count, objective)

    def score_counts(self, counts: np.ndarray, primitive_count: int, alpha: float) -> Score:
        """The objective of a hard union from how many primitives hold each point."""
        return self.score(counts > 0, counts > 1, primitive_count, alpha)

    def objective(
        self, held: np.ndarray, primitive_count: np.ndarray | int, alpha: float, false_volume: float = 1.0
    ):
        """The objective from sums, for many assemblies at once.

        Args:
            held: (..., 6): the four columns summed over covered points, box points covered, box points covered twice.
            primitive_count: of each.
            alpha: price of a primitive.
            false_volume: weight of volume outside the target, 1 for the objective itself.
        """
        near_in, near_out, box_in, box_out, box, twice = np.moveaxis(held, -1, 0)
        near = near_in / np.maximum(self.near_total + false_volume * near_out, 1e-9)
        volume = box_in / np.maximum(self.box_total + false_volume * box_out, 1e-9)
        overlap = twice / np.maximum(box, 1.0)
        return 0.5 * (near + volume) - alpha * primitive_count - OVERLAP_PRICE * overlap


class Chooser:
    """A growing choice among candidates, with what each further candidate would add kept up to date.

    Adding or removing a candidate changes only the points inside it, so the sums of all others are updated there
    instead of being taken anew over all points.
    """

    def __init__(self, bits: np.ndarray, tally: Tally, alpha: float):
        """`bits` (candidates, n) bool: which sample points each candidate holds."""
        self.tally, self.alpha = tally, alpha
        self.points = [np.flatnonzero(row) for row in bits]
        # Point-major, so that the points of one candidate are contiguous rows.
        self.by_point = np.ascontiguousarray(bits.T, dtype=np.float32)
        self.counts = np.zeros(bits.shape[1], np.int32)
        self.values = np.concatenate([tally.columns, tally.box[:, None]], axis=1)
        self.chosen: list[int] = []
        self.held = np.zeros(6)
        self.sums = np.zeros((len(bits), 6))
        self.sums[:, :5] = self.by_point.T @ self.values

    def copy(self) -> Chooser:
        """An independent choice that goes on from here."""
        other = object.__new__(Chooser)
        other.__dict__.update(self.__dict__)
        other.counts, other.held, other.sums = self.counts.copy(), self.held.copy(), self.sums.copy()
        other.chosen = list(self.chosen)
        return other

    def _change(self, index: int, step: int, mend_sums: bool = True) -> None:
        """Count the points of a candidate once more (step 1) or once less (-1), and mend all sums there.

        Without the sums it is much cheaper: enough for `score` and `best_removal`.
        """
        points = self.points[index]
        before = self.counts[points]
        after = before + step
        self.counts[points] = after
        freed = (after == 0).astype(np.float32) - (before == 0)
        once = (after == 1).astype(np.float32) - (before == 1)
        self.held[:5] -= freed @ self.values[points]
        self.held[5] += ((after > 1).astype(np.float32) - (before > 1)) @ self.tally.box[points]
        if not mend_sums:
            return
        moved = freed != 0
        self.sums[:, :5] += self.by_point[points[moved]].T @ (freed[moved, None] * self.values[points[moved]])
        moved = once != 0
        self.sums[:, 5] += self.by_point[points[moved]].T @ (once[moved] * self.tally.box[points[moved]])

    def add(self, index: int) -> None:
        """Choose a candidate."""
        self._change(index, 1)
        self.chosen.append(index)

    def remove(self, index: int) -> None:
        """Take a chosen candidate out."""
        self._change(index, -1)
        self.chosen.remove(index)

    def replace_redundant(self, index: int) -> list[int] | None:
        """Members that a candidate makes redundant, if adding it and removing them raises the objective.

        Leaves the choice as it was.
        """
        before, members = self.score(), list(self.chosen)
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
        self.chosen = members
        return leavers if rose else None

    def score(self) -> float:
        """The objective of the choice as it is."""
        return float(self.tally.objective(self.held, len(self.chosen), self.alpha))

    def best_addition(self, false_volume: float = 1.0) -> tuple[int, float]:
        """The candidate that raises the objective most, and by how much; (-1, -inf) where none is left."""
        gains = self.gains(false_volume)
        if not len(gains):
            return -1, -np.inf
        leader = int(np.argmax(gains))
        return leader, float(gains[leader])

    def gains(self, false_volume: float = 1.0) -> np.ndarray:
        """What each candidate would add to the objective, -inf for those chosen."""
        count = len(self.chosen)
        now = self.tally.objective(self.held, count, self.alpha, false_volume)
        gains = self.tally.objective(self.held + self.sums, count + 1, self.alpha, false_volume) - now
        gains[self.chosen] = -np.inf
        return gains

    def best_removal(self, keep: int = -1) -> tuple[int, float]:
        """The member, other than `keep`, whose removal raises the objective most, and by how much."""
        now, count = self.score(), len(self.chosen)
        best, best_gain = -1, -np.inf
        for member in self.chosen:
            if member == keep:
                continue
            points = self.points[member]
            counts = self.counts[points]
            alone = points[counts == 1]
            held = self.held.copy()
            held[:5] -= self.values[alone].sum(0)
            held[5] -= self.tally.box[points[counts == 2]].sum()
            gain = float(self.tally.objective(held, count - 1, self.alpha)) - now
            if gain > best_gain:
                best, best_gain = member, gain
        return best, best_gain
