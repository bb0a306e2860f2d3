"""The context of a search: what stays the same in a fit, the target's samples and grid, the options and the clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import warp as wp

from ...decomposition.target_cells import TargetCells, target_cells
from ...kernels.field.culling import BlockBounds, bound_blocks, cull
from ...kernels.field.evaluate import cell_centres, union_at
from ...kernels.field.points import PointBlocks, any_in_blocks, from_grid_blocks, grid_blocks, point_blocks
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.select.containment import PointContainment
from ...shape.deviation import surface_distances
from ...shape.target import Target
from ..config import FitConfig
from ..objective.objective import ObjectiveSamples, Tally
from ..objective.samples import objective_samples
from ..objective.scoring import values_at
from ..progress import Progress
from ..propose.split_merge import CoarseCells, Parts, coarse_cells, divide
from ..refine.refiner import REFINERS, Refiner
from .track_progress import TrackProgress


@dataclass(frozen=True, eq=False)
class TargetGrid:
    """The cell centres of a target's grid, and which of them it holds."""

    shape: tuple[int, int, int]
    points: PointBlocks
    bounds: BlockBounds
    inside: np.ndarray
    """(resolution,) * 3 bool: cells of the target."""
    inside_count: int
    inside_blocks: wp.array
    """Which blocks of points hold any of them."""

    @classmethod
    def of(cls, target: Target, device: wp.Device) -> TargetGrid:
        """The grid of a target."""
        shape, lower, spacing = cell_centres(target.resolution)
        points, inside = grid_blocks(shape, lower, spacing, device), target.grid < 0
        blocks = wp.array(any_in_blocks(inside), dtype=int, device=device)
        return cls(shape, points, bound_blocks(points), inside, int(np.count_nonzero(inside)), blocks)

    def field_and_iou(self, primitives: PrimitiveSet) -> tuple[np.ndarray, float]:
        """The union's distances at the cell centres, (resolution,) * 3 float32, and its IoU with the target.

        Outside both the field may be FAR.
        """
        lists = cull(primitives, self.points, self.bounds, self.inside_blocks)
        field = from_grid_blocks(union_at(primitives, self.points, lists=lists).numpy(), self.shape)
        held = field < 0
        both = np.count_nonzero(self.inside & held)
        return field, both / max(1, self.inside_count + np.count_nonzero(held) - both)


@dataclass(frozen=True, eq=False)
class SearchContext:
    """Constants of a track of a fit while it runs; a variant of it is made by `dataclasses.replace`.

    Rows are (k, ROW) in the target's normalised frame.
    """

    target: Target
    config: FitConfig
    device: wp.Device
    samples: ObjectiveSamples
    tally: Tally
    blocks: PointBlocks
    """The samples on the device."""
    containment: PointContainment
    grid: TargetGrid
    target_cells: TargetCells
    coarse_cells: CoarseCells
    coarse_blocks: PointBlocks
    """The centres of the coarse cells on the device."""
    refiner: Refiner
    progress: TrackProgress
    interrupted: Callable[[], bool]
    """The stop test of whoever asked for the fit."""
    begin: float
    """`time.perf_counter()` when the fit began."""

    def families(self, rows: np.ndarray) -> list[str]:
        """The family of each row."""
        return [self.config.primitive] * len(rows)

    def primitives(self, rows: np.ndarray) -> PrimitiveSet:
        """Rows on the device."""
        return PrimitiveSet(rows, self.families(rows), self.device)

    def inside(self, rows: np.ndarray) -> np.ndarray:
        """Membership bit masks: the samples that each primitive holds, (k, words) with a bit a sample."""
        return self.containment.masks(self.primitives(rows))

    def parts(self, rows: np.ndarray) -> Parts:
        """Partition of the target among the primitives."""
        values = values_at(rows, self.families(rows), self.coarse_blocks, self.device)
        owner = values.argmin(0).astype(np.int32)
        return divide(self.target_cells, owner[self.coarse_cells.around], len(rows))

    def deviation(self, rows: np.ndarray) -> float:
        """95th percentile of the two-sided surface distance, in the mesh's units."""
        distance = surface_distances(self.target, self.primitives(rows))
        return (
            np.inf if distance is None else float(np.percentile(distance, 95)) * self.target.transform.scale
        )

    def out_of_time(self) -> bool:
        """True if the time-out has passed."""
        return 0 < self.config.timeout < time.perf_counter() - self.begin

    def should_stop(self) -> bool:
        """True if the search is to return the best so far at once."""
        return self.interrupted() or self.out_of_time()


def search_context(
    target: Target,
    config: FitConfig,
    device: wp.Device,
    on_progress: Callable[[Progress], None] | None = None,
    should_stop: Callable[[], bool] = lambda: False,
) -> SearchContext:
    """The context of a fit that begins now; the arguments are those of `fit_target`."""
    begin, samples = time.perf_counter(), objective_samples(target)
    cells = target_cells(target.grid)
    coarse = coarse_cells(cells)
    return SearchContext(
        target=target,
        config=config,
        device=device,
        samples=samples,
        tally=Tally(samples),
        blocks=point_blocks(samples.points, device),
        containment=PointContainment(samples.points, device),
        grid=TargetGrid.of(target, device),
        target_cells=cells,
        coarse_cells=coarse,
        coarse_blocks=point_blocks(coarse.centres, device),
        refiner=REFINERS[config.optimizer](target, samples, config, device),
        progress=TrackProgress(on_progress, config.rounds),
        interrupted=should_stop,
        begin=begin,
    )
