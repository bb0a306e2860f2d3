"""A track of a fit: rounds from one beginning until they no longer pay.

A round decomposes what is unexplained, proposes, selects, refines and prunes.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence

import numpy as np
import warp as wp

from ...decomposition.coacd import propose_convex_regions
from ...decomposition.propose import find_parts, largest_parts
from ...decomposition.region import Region
from ...kernels.field.bounds import extents
from ...kernels.rows import BLEND
from ...kernels.runtime.launch import serial_device
from ...shape.target import Target
from ..config import FitConfig, RefineConfig
from ..objective.objective import at_price
from ..objective.outside_samples import with_outside_samples
from ..objective.scoring import choose_blends, sorted_by_volume
from ..outcome import Round, Status
from ..progress import Progress
from ..propose.candidate_pool import CandidatePool
from ..propose.candidates import seed_regions
from ..refine.adam import refine_with_adam
from ..refine.joint import refine
from ..select.selection import select
from .context import SearchContext

SATURATION = 1e-3
"""A round that raises the objective by less than this is the last."""

TRACK_SATURATION = 1.2e-2
"""The same in a track that is followed by more: what little it misses, the others find."""

JOINT_SATURATION = 2.5e-3
"""The same where the ends of several tracks are put together."""

RICH_ROUNDS = ((0.3, 2.5), (0.5, 2.0), (0.75, 1.4))
"""Price of a primitive, as a share of the full one, and weight of false volume in the first rounds. An assembly that
is rich and precise at first finds what belongs together; one that is poor and bulky at first stays so (a plate with
pockets as one box)."""

SECOND_RICH = ((0.4, 2.0), (0.7, 1.4))
"""The same of a second beginning."""

JOINT_RICH = ((0.7, 1.2),)
"""The same where the ends of several tracks are put together."""

THOROUGH = 2
"""Excursions from which a fit with as many parts as are allowed goes on: it exchanges them for better ones."""

ADAM_SEEDS = 7
"""Regions that a round seeds with the paper's optimiser: its seven steps of decomposition."""

STARTING_BLEND = 0.25
"""Blend of a new primitive, as a share of its thickness, until one is chosen for it."""

WIDEST_START = 0.05
"""The same at most, normalised units."""


class Search(SearchContext):
    """Rounds from one beginning, and the best set so far."""

    def __init__(
        self,
        target: Target,
        config: FitConfig,
        device: wp.Device,
        on_progress: Callable[[Progress], None] | None = None,
        should_stop: Callable[[], bool] = lambda: False,
        start_rows: np.ndarray | None = None,
    ):
        super().__init__(target, config, device, on_progress, should_stop, start_rows)
        self.candidate_pool = CandidatePool(self.inside, len(self.samples.points), device)
        self.slabs = config.excursions == 0
        """Whether slabs are proposed. The first of several tracks does without them: where big perforated pieces are on
        offer, a greedy choice takes them and never gets to what they are made of."""
        self.beginning: list[Region] | None = None
        """Parts of the whole target, slabs included, where two tracks begin with them."""
        self.saturation = SATURATION
        self.rounds: list[Round] = []
        self.best_rows, self.best_score, self.best_iou = self.rows, self.score, self.iou

    def branch(self, should_stop: Callable[[], bool]) -> Search:
        """Another track on the same target, from nothing and with slabs, that tells nobody of its progress."""
        other = copy.copy(self)
        other.slabs, other.rounds, other.timings = True, [], {}
        other.candidate_pool = CandidatePool(other.inside, len(self.samples.points), self.device)
        other.on_progress, other.interrupted = lambda progress: None, should_stop
        other.place = len(self.positions)
        self.positions.append(0.0)
        other.rows, other.field, other.iou = self.rows[:0], None, 0.0
        other.score = other.assess(other.rows)
        other.best_rows, other.best_score, other.best_iou = other.rows, other.score, other.iou
        return other

    def run_track(
        self, limit: int, beginning: tuple[tuple[float, float], ...], others: np.ndarray | None = None
    ) -> Status:
        """Rounds until one no longer pays.

        Args:
            limit: of rounds.
            beginning: price and weight of false volume of the first, rich rounds.
            others: rows of other tracks, on offer in the first round.
        """
        top, first = -np.inf, len(self.rounds)
        for since in range(limit):
            reason = self.reason_to_stop()
            if reason is not None:
                return reason
            rich = beginning[since] if since < len(beginning) and since + 1 < limit else None
            self.round(first + since, rich, others if not since else None)
            reason = self.reason_to_stop()
            if reason is not None:
                return reason
            if rich is None:
                score = at_price(self.score, self.price, self.alpha).objective
                if score - top <= self.saturation:
                    return Status.SATURATED
                top = score
        return Status.ROUNDS

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
        if len(self.rows) >= self.config.max_primitives and self.config.excursions < THOROUGH:
            return Status.MAX_PRIMITIVES
        return None

    def round(self, number: int, rich: tuple[float, float] | None, others: np.ndarray | None = None) -> None:
        """One round; `others` are further candidates.

        A rich round, given its share of the price and its weight of false volume, is gone on from whatever it comes
        to; a plain one only if the objective rises.
        """
        config = self.config
        share, false_volume = rich or (1.0, 1.0)
        self.alpha = self.price * share
        self.score = self.assess(self.rows)
        self.tell("decompose", number, 0.0)
        with self.timed("decompose"):
            regions = self.cut()
        if not regions or self.should_stop():
            return
        self.tell("propose", number, 0.15)
        with self.timed("propose"):
            remembered = self.propose(regions, number)
            candidates = remembered if others is None else np.concatenate([remembered, others])
            blends = starting_blends(candidates, self.families(candidates))
            candidates[:, BLEND] = blends if config.union == "smooth" else 0.0
            pool = np.concatenate([candidates, self.rows])
        if self.should_stop():
            return
        self.tell("select", number, 0.5)
        with self.timed("select"):
            chosen = self.choose(pool, len(candidates), false_volume)
        if not chosen:
            return
        self.tell("refine", number, 0.6)
        with self.timed("refine"):
            selected = pool[sorted_by_volume(pool, self.families(pool), chosen)]
            refined = self.refine(selected, number, config.refine if rich else config.sharpen)
        with self.timed("prune"):
            if config.union == "smooth":
                refined = choose_blends(self.values(refined), refined, self.tally, serial_device())
            kept, score = self.pruned(refined)
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
        self.remember_best()
        self.tell("prune", number, 1.0)

    def cut(self) -> list[Region]:
        """Regions of what is unexplained, and of what the primitives so far hold."""
        config, most = self.config, self.config.propose.regions
        if config.decompose == "coacd":
            return propose_convex_regions(self.target.grid, self.field, most, config.seed)
        if self.field is None and self.beginning is not None:
            parts = [part for part in self.beginning if self.slabs or part.source != "slab"]
        else:
            parts = self.find_parts(self.slabs)
        regions = largest_parts(parts, most)
        if config.optimizer == "adam":
            return [region for region in regions if region.source.startswith("msd")][:ADAM_SEEDS]
        return regions + (self.neighbour_regions() if len(self.rows) else [])

    def find_parts(self, slabs: bool) -> list[Region]:
        """Parts of what is unexplained, with or without slabs."""
        propose = self.config.propose
        return find_parts(
            self.target_cells,
            self.field,
            first_round=not len(self.rows),
            device=self.device,
            blocks=propose.blocks,
            slabs=propose.slabs and slabs,
            holes=propose.holes,
            most=propose.regions,
        )

    def propose(self, regions: list[Region], number: int) -> np.ndarray:
        """Candidates (count, ROW): fitted ones of this and earlier rounds, or the paper's seeds."""
        config = self.config
        if config.optimizer == "adam":
            return seed_regions(regions, config.primitive).rows
        return self.candidate_pool.fit_new(regions, self.target.grid, config, config.seed + number)

    def refine(self, rows: np.ndarray, number: int, settings: RefineConfig) -> np.ndarray:
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
        samples = self.samples
        if config.probes:
            samples = with_outside_samples(
                samples, rows, families, self.target, config.seed + number, self.device
            )
        return refine(rows, families, samples, settings, self.device, self.should_stop)

    def remember_best(self) -> None:
        """Keep the rows if they beat the best at the full price."""
        score = at_price(self.score, self.price, self.alpha)
        if score.objective > self.best_score.objective:
            self.best_rows, self.best_score, self.best_iou = self.rows, score, self.iou

    def choose(self, pool: np.ndarray, candidates: int, false_volume: float) -> list[int]:
        """Indices into the pool: first the memory's candidates and others, then the primitives so far, which may be
        swapped out."""
        start = range(candidates, len(pool))
        if self.config.optimizer == "adam":
            # The paper seeds all regions of a decomposition and lets optimisation and pruning decide.
            return [*start, *range(candidates)][: self.config.max_primitives]
        with self.candidate_pool.joined_by(pool[self.candidate_pool.coverage.count :]) as coverage:
            return select(
                coverage,
                self.tally,
                self.alpha,
                self.config.select,
                false_volume,
                start,
                self.config.max_primitives,
            )


def starting_blends(rows: np.ndarray, families: Sequence[str]) -> np.ndarray:
    """Blends (primitive_count,) of new primitives: thin ones would drown in a wide one."""
    thickness = extents(rows, families).min(1)
    return np.minimum(STARTING_BLEND * thickness, WIDEST_START)
