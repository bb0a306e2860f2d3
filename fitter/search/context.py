"""What every step of a fit works with: the target's samples and grid, the set of the moment, and the clock."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import warp as wp

from ...decomposition.region import Region
from ...decomposition.target_cells import target_cells
from ...kernels.field.combine import fold
from ...kernels.field.culling import bound_blocks, cull
from ...kernels.field.evaluate import cell_centres, union_at
from ...kernels.field.points import PointBlocks, any_in_blocks, from_grid_blocks, grid_blocks, point_blocks
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.rows import BLEND, ROW
from ...kernels.runtime.launch import serial_device
from ...kernels.select.containment import PointContainment
from ...kernels.select.coverage_sets import hold
from ...shape.deviation import surface_distances
from ...shape.target import Target
from ..config import FitConfig
from ..objective.objective import Score, Tally
from ..objective.samples import objective_samples
from ..objective.scoring import score_values, values_at
from ..progress import Progress
from ..propose.split_merge import Parts, coarse_cells, divide, halves, neighbour_pairs, part_regions
from ..select.selection import prune, without_air


class SearchContext:
    """One fit in progress: the target, what does not change between rounds, and the set of the moment."""

    def __init__(
        self,
        target: Target,
        config: FitConfig,
        device: wp.Device,
        on_progress: Callable[[Progress], None] | None = None,
        should_stop: Callable[[], bool] = lambda: False,
        start_rows: np.ndarray | None = None,
    ):
        self.target, self.config, self.device = target, config, device
        self.on_progress = on_progress or (lambda progress: None)
        self.interrupted = should_stop
        self.begin = time.perf_counter()
        self.samples = objective_samples(target)
        self.blocks: PointBlocks = point_blocks(self.samples.points, device)
        self.containment = PointContainment(self.samples.points, device)
        self.tally = Tally(self.samples)
        shape, lower, spacing = cell_centres(target.resolution)
        self.grid_shape = shape
        self.grid_points = grid_blocks(shape, lower, spacing, device)
        self.grid_bounds = bound_blocks(self.grid_points)
        self.inside_target = target.grid < 0
        self.inside_count = np.count_nonzero(self.inside_target)
        self.grid_wanted = wp.array(any_in_blocks(self.inside_target), dtype=int, device=device)
        self.target_cells = target_cells(target.grid)
        self.coarse_cells = coarse_cells(self.target_cells)
        self.coarse_blocks = point_blocks(self.coarse_cells.centres, device)
        self.price = self.alpha = config.parsimony
        self.timings: dict[str, float] = {}
        self.positions, self.place = [0.0], 0
        """Rounds done of each track, and this one's place among them."""
        self.rows = np.zeros((0, ROW), np.float32) if start_rows is None else start_rows.astype(np.float32)
        self.remembered = (
            np.zeros((0, BLEND), np.float32),
            np.zeros((0, len(self.samples.points)), np.float32),
        )
        """Rows without blends, and their values."""
        self.score = self.assess(self.rows)
        self.iou = 0.0
        self.field: np.ndarray | None = None
        if len(self.rows):
            self.look()

    def families(self, rows: np.ndarray) -> list[str]:
        """The family of each row."""
        return [self.config.primitive] * len(rows)

    def values(self, rows: np.ndarray) -> np.ndarray:
        """Distances (primitive_count, n) at the samples, whatever the blends; those of the last rows are remembered."""
        shapes, values = self.remembered
        if not np.array_equal(rows[:, :BLEND], shapes):
            values = values_at(rows, self.families(rows), self.blocks, self.device)
            self.remembered = rows[:, :BLEND].copy(), values
        return values

    def inside(self, rows: np.ndarray) -> np.ndarray:
        """Which samples each primitive holds, masks (primitive_count, words) with a bit a sample."""
        return self.containment.masks(PrimitiveSet(rows, self.families(rows), self.device))

    def assess(self, rows: np.ndarray) -> Score:
        """The objective of rows as they are, blends included."""
        return score_values(self.values(rows), rows[:, BLEND], self.tally, self.alpha)

    def pruned(self, rows: np.ndarray) -> tuple[np.ndarray, Score]:
        """Rows without the primitives that do not pay, and their score."""
        values = self.values(rows)
        left = prune(hold(values < 0, serial_device()), self.tally, self.alpha)
        if len(left) < len(rows):
            self.remembered = rows[left, :BLEND], values[left]
        return rows[left], self.assess(rows[left])

    def solid_rows(self, rows: np.ndarray) -> np.ndarray:
        """Rows without those that hold more air than solid."""
        return rows[without_air(hold(self.values(rows) < 0, serial_device()), self.tally)]

    def look(self) -> None:
        """Evaluate the best so far on the grid: its field, which the next residual needs, and its IoU.

        Outside both the field may be FAR.
        """
        with self.timed("field"):
            primitives = PrimitiveSet(self.rows, self.families(self.rows), self.device)
            lists = cull(primitives, self.grid_points, self.grid_bounds, self.grid_wanted)
            values = union_at(primitives, self.grid_points, lists=lists).numpy()
            self.field = from_grid_blocks(values, self.grid_shape)
            held = self.field < 0
            both = np.count_nonzero(self.inside_target & held)
            self.iou = both / max(1, self.inside_count + np.count_nonzero(held) - both)

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Add the wall time of a block to its stage."""
        begin = time.perf_counter()
        try:
            yield
        finally:
            self.timings[stage] = self.timings.get(stage, 0.0) + time.perf_counter() - begin

    def out_of_time(self) -> bool:
        """Whether the time-out has passed."""
        return 0 < self.config.timeout < time.perf_counter() - self.begin

    def should_stop(self) -> bool:
        """Whether to return the best so far at once."""
        return self.interrupted() or self.out_of_time()

    def tell(self, stage: str, number: int, within: float) -> None:
        """Report progress: `number` rounds and the share `within` of the next are done."""
        self.positions[self.place] = number + within
        done, rounds = sum(self.positions), self.config.rounds
        # Most fits saturate early: the share is that of a fit of half the allowed rounds, approached smoothly.
        share = 1.0 - 0.5 ** (done / max(1.0, 0.3 * rounds))
        self.on_progress(
            Progress(
                stage,
                min(int(done) + 1, rounds),
                rounds,
                len(self.rows),
                self.score.objective,
                self.iou,
                share,
                self.rows.copy(),
            )
        )

    def deviation(self) -> float:
        """95th percentile of the two-sided surface distance, in the mesh's units."""
        with self.timed("tolerance"):
            primitives = PrimitiveSet(self.rows, self.families(self.rows), self.device)
            distance = surface_distances(self.target, primitives)
        return (
            np.inf if distance is None else float(np.percentile(distance, 95)) * self.target.transform.scale
        )

    def errors(self) -> np.ndarray:
        """Weight of the wrong samples that each primitive answers for, (primitive_count,)."""
        values = self.values(self.rows)
        wrong = (fold(values, self.rows[:, BLEND]) < 0) != self.samples.inside
        owners = values[:, wrong].argmin(0)
        return np.bincount(owners, self.samples.weight[wrong], minlength=len(self.rows))

    def parts(self) -> Parts:
        """What each primitive holds of the target."""
        values = values_at(self.rows, self.families(self.rows), self.coarse_blocks, self.device)
        owner = values.argmin(0).astype(np.int32)
        return divide(self.target_cells, owner[self.coarse_cells.around], len(self.rows))

    def neighbour_regions(self) -> list[Region]:
        """Parts of what single primitives hold, where they fit badly, and what touching pairs hold, to be merged."""
        settings, parts = self.config.propose, self.parts()
        pairs = neighbour_pairs(parts)[: settings.merges]
        worst = np.argsort(-self.errors(), kind="stable")[: settings.splits]
        singles = part_regions(parts, [(int(k),) for k in worst], "part")
        split = [half for region in singles for half in halves(region)]
        return singles + split + part_regions(parts, pairs, "pair")
