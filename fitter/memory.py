"""Candidates of earlier rounds: a region tried already is not fitted again, and what it gave stays on offer."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import warp as wp

from ..decomposition.region import Region
from ..kernels.occupancy import Holdings
from ..kernels.rows import ROW
from .config import FitConfig
from .propose import fit_regions

SAME_SHARE = 0.85
"""Regions that share more than this of their union are one."""
REMEMBERED = 600
"""Regions kept: the latest ones."""


class CandidateMemory:
    """Regions tried so far, with the candidates fitted to each and the sample points that those hold."""

    def __init__(
        self, inside: Callable[[np.ndarray], np.ndarray], point_count: int, device: wp.Device
    ) -> None:
        """`inside` says of rows (k, ROW) which of the `point_count` samples each holds, as masks (k, words) uint32;
        `device` is where they are counted."""
        self.inside = inside
        self.device = device
        self.regions: list[Region] = []
        self.rows: list[np.ndarray] = []
        self.holdings = Holdings(point_count, device)
        self.boxes = np.zeros((0, 7))

    def fit_new(self, regions: list[Region], grid: np.ndarray, config: FitConfig, seed: int) -> np.ndarray:
        """Fit the regions that are new, and return all candidates remembered, (count, ROW) float32."""
        new: list[Region] = []
        for region in regions:
            if not self._known(region):
                new.append(region)
                self.regions.append(region)
                self.boxes = np.concatenate([self.boxes, _box(region)[None]])
        if new:
            fitted = fit_regions(new, grid, config.primitive, config.propose, seed, self.device)
            order = np.argsort(fitted.region, kind="stable")
            self.rows += [fitted.rows[fitted.region == index] for index in range(len(new))]
            self.holdings.append(self.inside(fitted.rows[order]))
        self._forget(len(self.regions) - REMEMBERED)
        return self.candidates()

    def _forget(self, count: int) -> None:
        """Forget the oldest regions."""
        if count > 0:
            self.holdings.drop_first(sum(len(rows) for rows in self.rows[:count]))
            self.regions, self.rows, self.boxes = self.regions[count:], self.rows[count:], self.boxes[count:]

    def take(self, other: CandidateMemory) -> None:
        """Remember what another memory of the same samples does and this one does not."""
        new = [index for index, region in enumerate(other.regions) if not self._known(region)]
        self.regions += [other.regions[index] for index in new]
        self.rows += [other.rows[index] for index in new]
        ends = np.cumsum([len(rows) for rows in other.rows])
        places = [np.arange(ends[index] - len(other.rows[index]), ends[index]) for index in new]
        self.holdings.append_from(other.holdings, np.concatenate([np.zeros(0, np.int64), *places]))
        self.boxes = np.concatenate([self.boxes, other.boxes[new]])

    @contextmanager
    def joined_by(self, rows: np.ndarray) -> Iterator[Holdings]:
        """What all candidates remembered hold, and after them `rows` (k, ROW), for the time being."""
        count = self.holdings.count
        self.holdings.append(self.inside(rows))
        try:
            yield self.holdings
        finally:
            self.holdings.truncate(count)

    def candidates(self) -> np.ndarray:
        """All candidates remembered, (count, ROW) float32."""
        return np.concatenate(self.rows) if self.rows else np.zeros((0, ROW), np.float32)

    def _known(self, region: Region) -> bool:
        """Whether a region like it was tried; boxes and volumes rule most out without looking at cells."""
        if not self.regions:
            return False
        box = _box(region)
        low, high = np.maximum(self.boxes[:, :3], box[:3]), np.minimum(self.boxes[:, 3:6], box[3:6])
        common = np.maximum(high - low, 0).prod(1)
        union = (self.boxes[:, 3:6] - self.boxes[:, :3]).prod(1) + (box[3:6] - box[:3]).prod() - common
        volume = np.minimum(self.boxes[:, 6], box[6]) / np.maximum(self.boxes[:, 6], box[6])
        alike = np.flatnonzero((common > 0.6 * union) & (volume > SAME_SHARE))
        return any(region.overlap(self.regions[index]) > SAME_SHARE for index in alike)


def _box(region: Region) -> np.ndarray:
    """Lower and upper corner in cells, and the volume: (7,)."""
    return np.concatenate([region.lower, region.lower + region.mask.shape, [region.volume]]).astype(
        np.float64
    )
