"""Residual Primitive Fitting: decompose what is unexplained, propose, select, refine, prune, and again."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from ..decomposition.coacd import propose_convex_regions
from ..decomposition.neighbours import coarse_inside, halves, label_parts, neighbour_pairs, part_regions
from ..decomposition.propose import propose_regions
from ..decomposition.region import Region
from ..kernels.field import cell_centres, union_at
from ..kernels.points import PointBlocks, from_grid_blocks, grid_blocks, point_blocks
from ..kernels.primitive_set import PrimitiveSet
from ..kernels.rows import BLEND, ROW
from ..target.deviation import surface_distances
from ..target.target import Target
from .adam import refine_with_adam
from .assess import choose_blends, rough_volume, score_values, sorted_by_volume, values_at
from .config import FitConfig
from .memory import CandidateMemory
from .objective import Score, Tally
from .outcome import Outcome, Round, Status
from .propose import seed_regions
from .refine import fold, refine
from .samples import objective_samples
from .select import prune, select

SATURATION = 1e-3
"""A round that raises the objective by less than this is the last."""

RICH_ROUNDS = ((0.3, 2.5), (0.5, 2.0), (0.75, 1.4))
"""Price of a primitive, as a share of the full one, and weight of false volume in the first rounds. An assembly that
is rich and precise at first finds what belongs together; one that is poor and bulky at first stays so (a plate with
pockets as one box)."""

ADAM_SEEDS = 7
"""Regions that a round seeds with the paper's optimiser: its seven steps of decomposition."""

REACHED = (Status.TARGET_IOU, Status.TOLERANCE)
"""Stops that the rows of the moment have earned: another set, or a last polish by the objective, may fall short."""

STARTING_BLEND = 0.02
"""Blend radius of new primitives while they are refined; the last step chooses one for each."""


@dataclass(frozen=True)
class Progress:
    """Where a fit is, for whoever shows it."""

    stage: str
    round: int
    rounds: int
    primitive_count: int
    objective: float
    iou: float
    fraction: float
    """Rough share of the work done, 0 to 1."""


class Fit:
    """One fit in progress: the target, what does not change between rounds, and the best so far."""

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
        self.tally = Tally(self.samples)
        shape, lower, spacing = cell_centres(target.resolution)
        self.grid_shape = shape
        self.grid_points = grid_blocks(shape, lower, spacing, device)
        self.memory = CandidateMemory()
        self.alpha = config.parsimony
        self.rounds: list[Round] = []
        self.timings: dict[str, float] = {}
        self.rows = np.zeros((0, ROW), np.float32) if start_rows is None else start_rows.astype(np.float32)
        self.score = self.assess(self.rows)
        self.iou = 0.0
        self.field: np.ndarray | None = None
        if len(self.rows):
            self.look()
        self.best_rows, self.best_score, self.best_iou = self.rows, self.score, self.iou

    # What everything below asks -----------------------------------------------------------------------------------

    def families(self, rows: np.ndarray) -> list[str]:
        """The family of each row."""
        return [self.config.primitive] * len(rows)

    def values(self, rows: np.ndarray) -> np.ndarray:
        """Distances (primitive_count, n) at the samples."""
        return values_at(rows, self.families(rows), self.blocks, self.device)

    def assess(self, rows: np.ndarray) -> Score:
        """The objective of rows as they are, blends included."""
        return score_values(self.values(rows), rows[:, BLEND], self.tally, self.alpha)

    def look(self) -> None:
        """Evaluate the best so far on the grid: its field, which the next residual needs, and its IoU."""
        with self.timed("field"):
            primitives = PrimitiveSet(self.rows, self.families(self.rows), self.device)
            self.field = from_grid_blocks(union_at(primitives, self.grid_points).numpy(), self.grid_shape)
            inside, held = self.target.grid < 0, self.field < 0
            self.iou = float((inside & held).sum() / max(1, (inside | held).sum()))

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
        """Report progress: `within` is the share of the round that is done."""
        rounds = self.config.rounds
        # Most fits saturate early: the share is that of a fit of half the allowed rounds, approached smoothly.
        done = 1.0 - 0.5 ** ((number + within) / max(1.0, 0.3 * rounds))
        self.on_progress(
            Progress(stage, number + 1, rounds, len(self.rows), self.score.objective, self.iou, done)
        )

    # The rounds ---------------------------------------------------------------------------------------------------

    def run(self) -> Outcome:
        """All rounds, then the blends and a last refinement."""
        status, excursions, since = Status.ROUNDS, self.config.excursions, 0
        for number in range(self.config.rounds):
            reason = self.reason_to_stop()
            if reason is None:
                last = number + 1 == self.config.rounds
                rich = RICH_ROUNDS[since] if since < len(RICH_ROUNDS) and not last else None
                rose = self.round(number, rich)
                since += 1
                reason = self.reason_to_stop()
                if reason is None and not rose and rich is None:
                    # One more try from a rich assembly, if there is room to make it plain again.
                    if excursions and self.config.rounds - number > len(RICH_ROUNDS) + 1:
                        excursions, since = excursions - 1, 0
                    else:
                        reason = Status.SATURATED
            if reason is not None:
                status = reason
                break
        if status in REACHED:
            self.score = replace_price(self.score, self.config.parsimony, self.alpha)
        else:
            self.rows, self.score, self.iou = self.best_rows, self.best_score, self.best_iou
            if not status.stopped_early:
                self.finish()
        order = (
            np.argsort(-rough_volume(self.rows), kind="stable")
            if self.config.union == "hard"
            else slice(None)
        )
        return Outcome(
            self.rows[order],
            self.families(self.rows),
            self.score,
            self.iou,
            status,
            self.rounds,
            self.timings,
        )

    def reason_to_stop(self) -> Status | None:
        """The stop that holds now, if any."""
        if self.interrupted():
            return Status.INTERRUPTED
        if self.out_of_time():
            return Status.TIMEOUT
        if self.iou >= self.config.target_iou and self.config.target_iou < 1.0:
            return Status.TARGET_IOU
        if len(self.rows) and self.config.tolerance > 0 and self.deviation() <= self.config.tolerance:
            return Status.TOLERANCE
        if len(self.rows) >= self.config.max_primitives:
            return Status.MAX_PRIMITIVES
        return None

    def deviation(self) -> float:
        """95th percentile of the two-sided surface distance, in the mesh's units."""
        with self.timed("tolerance"):
            primitives = PrimitiveSet(self.rows, self.families(self.rows), self.device)
            distance = surface_distances(self.target, primitives)
        return (
            np.inf if distance is None else float(np.percentile(distance, 95)) * self.target.transform.scale
        )

    def round(self, number: int, rich: tuple[float, float] | None) -> bool:
        """One round. Returns whether the best so far rose enough.

        A rich round, given its share of the price and its weight of false volume, is gone on from whatever it comes
        to; a plain one only if the objective rises.
        """
        config = self.config
        share, false_volume = rich or (1.0, 1.0)
        self.alpha = config.parsimony * share
        self.score = self.assess(self.rows)
        self.tell("decompose", number, 0.0)
        with self.timed("decompose"):
            regions = self.cut()
        if not regions or self.should_stop():
            return False
        self.tell("propose", number, 0.15)
        with self.timed("propose"):
            candidates = self.memory.fit_new(
                regions, self.target.grid, config, config.seed + number, self.device
            )
            pool = np.concatenate([self.rows, candidates])
            blend = STARTING_BLEND if config.union == "smooth" else 0.0
            pool[len(self.rows) :, BLEND] = blend
        if self.should_stop():
            return False
        self.tell("select", number, 0.5)
        with self.timed("select"):
            chosen = self.choose(pool, false_volume)
        if not chosen:
            return False
        self.tell("refine", number, 0.6)
        with self.timed("refine"):
            selected = pool[sorted_by_volume(pool, chosen)]
            refined = self.refine(selected, number)
        with self.timed("prune"):
            kept = refined[prune(self.values(refined) < 0, self.tally, self.alpha, self.device)]
            score = self.assess(kept)
        accepted = rich is not None or score.objective > self.score.objective
        self.rounds.append(
            Round(
                [region.describe() for region in regions],
                candidates,
                selected,
                refined,
                kept,
                score,
                accepted,
            )
        )
        if accepted:
            self.rows, self.score = kept, score
            self.look()
        rise = self.remember_best()
        self.tell("prune", number, 1.0)
        return rise > SATURATION

    def cut(self) -> list[Region]:
        """Regions of what is unexplained, and of what the primitives so far hold."""
        config, most = self.config, self.config.propose.regions
        if config.decompose == "coacd":
            return propose_convex_regions(self.target.grid, self.field, most, config.seed)
        regions = propose_regions(
            self.target.grid, self.field, first_round=not len(self.rows), device=self.device, most=most
        )
        if config.optimizer == "adam":
            return [region for region in regions if region.source.startswith("msd")][:ADAM_SEEDS]
        return regions + (self.neighbour_regions() if len(self.rows) else [])

    def propose(self, regions: list[Region], number: int) -> np.ndarray:
        """Candidates (count, ROW): fitted ones of this and earlier rounds, or the paper's seeds."""
        config = self.config
        if config.optimizer == "adam":
            return seed_regions(regions, config.primitive).rows
        return self.memory.fit_new(regions, self.target.grid, config, config.seed + number, self.device)

    def refine(self, rows: np.ndarray, number: int) -> np.ndarray:
        """All primitives moved together by the chosen optimiser."""
        config, families = self.config, self.families(rows)
        if config.optimizer == "adam":
            return refine_with_adam(
                rows,
                families,
                self.samples,
                config.adam,
                config.seed + number,
                self.device,
                self.should_stop,
                self.target.query.signed_distance,
            )
        return refine(rows, families, self.samples, config.refine, self.device, self.should_stop)

    def remember_best(self) -> float:
        """Keep the rows if they beat the best at the full price; returns by how much they do."""
        score = replace_price(self.score, self.config.parsimony, self.alpha)
        rise = score.objective - self.best_score.objective
        if rise > 0:
            self.best_rows, self.best_score, self.best_iou = self.rows, score, self.iou
        return rise

    def neighbour_regions(self) -> list[Region]:
        """Parts of what single primitives hold, where they fit badly, and what touching pairs hold, to be merged."""
        count, settings = len(self.rows), self.config.propose
        cells, centres = coarse_inside(self.target.grid)
        values = values_at(
            self.rows, self.families(self.rows), point_blocks(centres, self.device), self.device
        )
        labels = label_parts(self.target.grid, values.argmin(0), cells)
        pairs = neighbour_pairs(labels, count)[: settings.merges]
        worst = np.argsort(-self.errors(), kind="stable")[: settings.splits]
        singles = part_regions(labels, [(int(k),) for k in worst], "part")
        split = [half for region in singles for half in halves(region)]
        return singles + split + part_regions(labels, pairs, "pair")

    def errors(self) -> np.ndarray:
        """Weight of the wrong samples that each primitive answers for, (primitive_count,)."""
        values = self.values(self.rows)
        wrong = (fold(values, self.rows[:, BLEND]) < 0) != self.samples.inside
        owners = values[:, wrong].argmin(0)
        return np.bincount(owners, self.samples.weight[wrong], minlength=len(self.rows))

    def choose(self, pool: np.ndarray, false_volume: float) -> list[int]:
        """Indices into the pool; the primitives so far come first in it and may be swapped out."""
        if self.config.optimizer == "adam":
            # The paper seeds all regions of a decomposition and lets optimisation and pruning decide.
            return list(range(min(len(pool), self.config.max_primitives)))
        bits = self.values(pool) < 0
        return select(
            bits,
            self.tally,
            self.alpha,
            self.config.select,
            self.device,
            false_volume,
            len(self.rows),
            self.config.max_primitives,
        )

    def finish(self) -> None:
        """Blends, then a last sharp refinement; kept only where the objective rises."""
        if not len(self.rows):
            return
        self.alpha = self.config.parsimony
        with self.timed("finish"):
            rows = self.rows
            if self.config.union == "smooth":
                rows = choose_blends(self.values(rows), rows, self.tally, self.alpha)
            sharp = replace(self.config.refine, betas=(80.0, 250.0))
            tries = [rows]
            if self.config.optimizer == "levenberg":
                tries.append(
                    refine(rows, self.families(rows), self.samples, sharp, self.device, self.should_stop)
                )
            for candidate in tries:
                kept = candidate[prune(self.values(candidate) < 0, self.tally, self.alpha, self.device)]
                score = self.assess(kept)
                if score.objective > self.score.objective:
                    self.rows, self.score = kept, score
        self.look()


def replace_price(score: Score, alpha: float, before: float) -> Score:
    """The score with another price of a primitive."""
    return replace(score, objective=score.objective + (before - alpha) * score.primitive_count)


def fit_target(
    target: Target,
    config: FitConfig,
    device: wp.Device,
    on_progress: Callable[[Progress], None] | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    start_rows: np.ndarray | None = None,
) -> Outcome:
    """Fit an assembly to a target.

    Args:
        target: from `make_target`.
        config: options.
        device: where the kernels run.
        on_progress: called at each stage.
        should_stop: asked often; once True, the best so far is returned.
        start_rows: (k, ROW) primitives to begin with, `config.primitive`'s family.
    """
    return Fit(target, config, device, on_progress, should_stop, start_rows).run()
