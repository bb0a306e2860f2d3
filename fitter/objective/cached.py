"""The objective of primitives on a target, and their distances, asked again and again while few of them change."""

from __future__ import annotations

import numpy as np
import warp as wp

from ...kernels.field.points import PointBlocks, point_blocks
from ...kernels.rows import BLEND
from ...shape.target import Target
from ..config import FitConfig
from .objective import ObjectiveSamples, Score, Tally
from .samples import objective_samples
from .scoring import score_values, values_at

MOST_KNOWN = 400
"""Distances of primitives kept at most: 160 kB each."""


class DistanceCache:
    """Distances at fixed points, of the primitives seen last."""

    def __init__(self, blocks: PointBlocks, family: str, device: wp.Device, most: int = MOST_KNOWN):
        """Distances at the points of `blocks` of primitives of one family; about `most` are kept beside the last."""
        self._blocks, self._family, self._device, self._most = blocks, family, device, most
        self._known: dict[bytes, np.ndarray] = {}

    def values(self, rows: np.ndarray) -> np.ndarray:
        """Distances (primitive_count, n), whatever the blends; only rows not seen of late cost."""
        keys = [row[:BLEND].tobytes() for row in rows]
        new = [index for index, key in enumerate(keys) if key not in self._known]
        if new:
            fresh = values_at(rows[new], [self._family] * len(new), self._blocks, self._device)
            if len(self._known) > self._most:
                kept = set(keys)
                self._known = {key: value for key, value in self._known.items() if key in kept}
            self._known.update((keys[index], value) for index, value in zip(new, fresh, strict=True))
        if not len(rows):
            return np.zeros((0, self._blocks.count), np.float32)
        return np.stack([self._known[key] for key in keys])


class CachedObjective:
    """The samples of a fit, and the distances of the primitives seen last.

    Attributes:
        samples, tally: of the target, as in its fit.
        alpha: price of a primitive.
        distances: at the samples.
    """

    def __init__(self, target: Target, config: FitConfig, device: wp.Device, alpha: float | None = None):
        """The objective at `alpha`, that of the configuration unless given."""
        self.samples: ObjectiveSamples = objective_samples(target)
        self.tally = Tally(self.samples)
        self.alpha = config.parsimony if alpha is None else alpha
        self.config, self.device = config, device
        self.distances = DistanceCache(point_blocks(self.samples.points, device), config.primitive, device)

    def families(self, rows: np.ndarray) -> list[str]:
        """The family of each row."""
        return [self.config.primitive] * len(rows)

    def values(self, rows: np.ndarray) -> np.ndarray:
        """Distances (primitive_count, n) at the samples; only rows not seen of late cost."""
        return self.distances.values(rows)

    def score(self, rows: np.ndarray) -> Score:
        """The objective of the smooth union of rows."""
        return score_values(self.values(rows), rows[:, BLEND], self.tally, self.alpha)

    def objective(self, rows: np.ndarray) -> float:
        """Its value alone."""
        return self.score(rows).objective
