"""Candidates of earlier rounds: a region tried already is not fitted again, and what it gave stays on offer."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import warp as wp

from ...decomposition.region import Region, box_table, common_boxes
from ...kernels.rows import ROW
from ...kernels.runtime.launch import serial_device
from ...kernels.select.coverage_sets import CandidateCoverage
from ..config import FitConfig
from .candidates import fit_regions

SAME_SHARE = 0.85
"""Regions that share more than this of their union are one."""
REMEMBERED = 600
"""Regions kept: the latest ones."""


class CandidatePool:
    """Regions tried so far, with the candidates fitted to each and the sample points that those hold."""

    def __init__(
        self, inside: Callable[[np.ndarray], np.ndarray], point_count: int, device: wp.Device
    ) -> None:
        """`inside` says of rows (k, ROW) which of the `point_count` samples each holds, as masks (k, words) uint32;
        `device` is where regions are fitted."""
        self.inside = inside
        self.device = device
        self.regions: list[Region] = []
        self.rows: list[np.ndarray] = []
        self.coverage = CandidateCoverage(point_count, serial_device())
        self.boxes = np.zeros((0, 7))

    def fit_new(self, regions: list[Region], grid: np.ndarray, config: FitConfig, seed: int) -> np.ndarray:
        """Fit the regions that are new, and return all candidates remembered, (count, ROW) float32."""
        boxes = box_table(regions)
        chosen = self._new(regions, boxes)
        new = [regions[index] for index in chosen]
        self.regions += new
        self.boxes = np.concatenate([self.boxes, boxes[chosen]])
        if new:
            fitted = fit_regions(new, grid, config.primitive, config.propose, seed, self.device)
            order = np.argsort(fitted.region, kind="stable")
            self.rows += [fitted.rows[fitted.region == index] for index in range(len(new))]
            self.coverage.append(self.inside(fitted.rows[order]))
        self._forget(len(self.regions) - REMEMBERED)
        return self.candidates()

    def _forget(self, count: int) -> None:
        """Forget the oldest regions."""
        if count > 0:
            self.coverage.drop_first(sum(len(rows) for rows in self.rows[:count]))
            self.regions, self.rows, self.boxes = self.regions[count:], self.rows[count:], self.boxes[count:]

    def take(self, other: CandidatePool) -> None:
        """Remember what another memory of the same samples does and this one does not."""
        new = self._new(other.regions, other.boxes)
        self.regions += [other.regions[index] for index in new]
        self.rows += [other.rows[index] for index in new]
        ends = np.cumsum([len(rows) for rows in other.rows])
        places = [np.arange(ends[index] - len(other.rows[index]), ends[index]) for index in new]
        self.coverage.append_from(other.coverage, np.concatenate([np.zeros(0, np.int64), *places]))
        self.boxes = np.concatenate([self.boxes, other.boxes[new]])

    def copy(self) -> CandidatePool:
        """Another memory of the same."""
        other = CandidatePool(self.inside, self.coverage.point_count, self.device)
        other.take(self)
        return other

    @contextmanager
    def joined_by(self, rows: np.ndarray) -> Iterator[CandidateCoverage]:
        """Coverage of all candidates remembered, and after them of `rows` (k, ROW), for the time being."""
        count = self.coverage.count
        self.coverage.append(self.inside(rows))
        try:
            yield self.coverage
        finally:
            self.coverage.truncate(count)

    def candidates(self) -> np.ndarray:
        """All candidates remembered, (count, ROW) float32."""
        return np.concatenate(self.rows) if self.rows else np.zeros((0, ROW), np.float32)

    def _new(self, regions: list[Region], boxes: np.ndarray) -> list[int]:
        """Indices of the regions, given their boxes, that are like none tried and like none before them.

        Boxes and volumes rule most pairs out without a look at their cells.
        """
        tried, others = len(self.regions), [*self.regions, *regions]
        table = np.concatenate([self.boxes, boxes])
        common, volume = common_boxes(boxes, table), (table[:, 3:6] - table[:, :3]).prod(1)
        union = volume[tried:, None] + volume - common
        ratio = np.minimum(boxes[:, 6:], table[:, 6]) / np.maximum(boxes[:, 6:], table[:, 6])
        alike = (common > 0.6 * union) & (ratio > SAME_SHARE)
        new: list[int] = []
        for index, region in enumerate(regions):
            near = np.flatnonzero(alike[index, : tried + index])
            if any(region.overlap(others[other]) > SAME_SHARE for other in near):
                alike[:, tried + index] = False
            else:
                new.append(index)
        return new
