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
    """Sums over the samples, by column: near inside, near outside, box inside, box outside (weights included)."""

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

    def gains(
        self,
        bits: np.ndarray,
        counts: np.ndarray,
        primitive_count: int,
        alpha: float,
        false_volume: float,
    ) -> np.ndarray:
        """Objective that each candidate would add to the chosen ones.

        Args:
            bits: (candidates, n) float32 0 / 1, in the candidate.
            counts: (n,) how many chosen primitives hold each point.
            primitive_count: chosen so far.
            alpha: price of a primitive.
            false_volume: weight of volume outside the target, 1 for the objective itself.
        """
        free = (counts == 0).astype(np.float32)[:, None]
        once = ((counts == 1) * self.box)[:, None]
        sums = bits @ np.concatenate([self.columns * free, once, self.box[:, None] * free], axis=1)
        held = (counts > 0).astype(np.float32) @ self.columns
        box_held, twice_held = float(((counts > 0) * self.box).sum()), float(((counts > 1) * self.box).sum())

        def objective(near_in, near_out, box_in, box_out, twice, box, number):
            near = near_in / np.maximum(self.near_total + false_volume * near_out, 1e-9)
            volume = box_in / np.maximum(self.box_total + false_volume * box_out, 1e-9)
            return 0.5 * (near + volume) - alpha * number - OVERLAP_PRICE * twice / np.maximum(box, 1.0)

        now = objective(*held, twice_held, box_held, primitive_count)
        total = held + sums[:, :4]
        after = objective(*total.T, twice_held + sums[:, 4], box_held + sums[:, 5], primitive_count + 1)
        return after - now
