"""The objective on fixed sample points: its prices, and the sums of the points that an assembly covers.

Points near the surface are weighted by curvature; those of the box are uniform (`kernels/objective_sums.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...kernels.select.objective_sums import KINDS, Prices, Sums, objective, objective_terms

OVERLAP_PRICE = 0.1
"""Objective lost to a share of the volume that lies in more than one primitive."""

SEARCH_OVERLAP_PRICE = 0.03
"""The same while candidates are chosen: refinement takes overlaps away, and at the full price too few are chosen."""


UNOVERLAP_PRICE = 0.25
"""Objective lost to a share of the volume that no primitive holds, only the blends between them: shape that shows in
no part is shape that nobody can edit."""


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
    unoverlap: float
    primitive_count: int
    objective: float

    @property
    def recovery(self) -> float:
        """R, without the price of primitives and overlap."""
        return 0.5 * (self.near_iou + self.volume_iou)


def at_price(score: Score, alpha: float, before: float) -> Score:
    """The score with another price of a primitive than the one `before`."""
    return replace(score, objective=score.objective + (before - alpha) * score.primitive_count)


class Tally:
    """The samples in four classes: 0 near and inside, 1 near and outside, 2 box and inside, 3 box and outside.

    Sums are taken in a fixed order in float64: a matrix product would depend on how many cores the library uses.
    """

    def __init__(self, samples: ObjectiveSamples):
        near = np.arange(len(samples.points)) < samples.near_count
        self.kind = np.where(near, 0, 2) + np.where(samples.inside, 0, 1)
        self.weight = samples.weight.astype(np.float64)
        self.box = ~near
        everything = np.ones(len(near), bool)
        self.near_total, _, self.box_total, _ = self.sums(everything)

    def sums(self, points: np.ndarray) -> np.ndarray:
        """Weight of the given points (mask or indices) by class, (4,) float64."""
        return np.bincount(self.kind[points], self.weight[points], minlength=KINDS)

    def prices(
        self,
        alpha: float,
        overlap: float = OVERLAP_PRICE,
        unoverlap: float = UNOVERLAP_PRICE,
        false_volume: float = 1.0,
    ) -> Prices:
        """Prices of the objective: what it is made of beside sums.

        Args:
            alpha: price of a primitive.
            overlap, unoverlap: prices of shares of the volume.
            false_volume: weight of volume outside the target, 1 for the objective itself.
        """
        return Prices(self.near_total, self.box_total, alpha, overlap, unoverlap, false_volume)

    def score(self, covered: np.ndarray, held: np.ndarray, primitive_count: int, alpha: float) -> Score:
        """The objective of an assembly.

        Args:
            covered: (n,) bool, in the union.
            held: (n,) how many primitives hold each point.
            primitive_count: of the assembly.
            alpha: price of a primitive.
        """
        sums = Sums(
            *self.sums(covered),
            twice=((held > 1) & self.box).sum(),
            bare=(covered & (held == 0) & self.box).sum(),
        )
        prices = self.prices(alpha)
        near_iou, volume_iou, overlap, unoverlap = (float(term) for term in objective_terms(sums, prices))
        worth = float(objective(sums, primitive_count, prices))
        return Score(near_iou, volume_iou, overlap, unoverlap, primitive_count, worth)
