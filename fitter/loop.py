"""Residual Primitive Fitting: decompose what is unexplained, propose, select, refine, prune, and again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import warp as wp

from ..decomposition.coacd import propose_convex_regions
from ..decomposition.propose import propose_regions
from ..decomposition.region import Region
from ..kernels.rows import BLEND, SHAPES
from ..target.target import Target
from .adam import refine_with_adam
from .assess import choose_blends, rough_volume, sorted_by_volume
from .config import FitConfig, RefineConfig
from .memory import CandidateMemory
from .merge import mergers
from .objective import Score
from .outcome import Outcome, Round, Status
from .probes import with_probes
from .propose import seed_regions
from .refine import refine
from .select import prune, select
from .workbench import Progress, Workbench

SATURATION = 1e-3
"""A round that raises the objective by less than this is the last."""

RICH_ROUNDS = ((0.3, 2.5), (0.5, 2.0), (0.75, 1.4))
"""Price of a primitive, as a share of the full one, and weight of false volume in the first rounds. An assembly that
is rich and precise at first finds what belongs together; one that is poor and bulky at first stays so (a plate with
pockets as one box)."""

SECOND_RICH = ((0.4, 2.0), (0.7, 1.4))
"""The same of a second beginning, which has the candidates of the first."""

MERGED = (40.0, 300.0)
"""Sharpness of the refinement of a merged part and those around it."""

ADAM_SEEDS = 7
"""Regions that a round seeds with the paper's optimiser: its seven steps of decomposition."""

REACHED = (Status.TARGET_IOU, Status.TOLERANCE)
"""Stops that the rows of the moment have earned: another set, or a last polish by the objective, may fall short."""

STARTING_BLEND = 0.25
"""Blend of a new primitive, as a share of its thickness, until one is chosen for it."""

WIDEST_START = 0.05
"""The same at most, normalised units."""


class Fit(Workbench):
    """The rounds of a fit, and the best set so far."""

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
        self.memory = CandidateMemory(self.inside)
        self.slabs = config.excursions == 0
        """Whether slabs are proposed. The first of several tracks does without them: where big perforated pieces are on
        offer, a greedy choice takes them and never gets to what they are made of."""
        self.rounds: list[Round] = []
        self.best_rows, self.best_score, self.best_iou = self.rows, self.score, self.iou

    def run(self) -> Outcome:
        """All rounds, then the blends and a last refinement."""
        status = self.run_tracks()
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

    def run_tracks(self) -> Status:
        """Tracks one after the other, each until it saturates; then what they found is put together.

        A greedy search ends where its beginning leads it. A second beginning, from nothing and with slabs too, ends
        elsewhere; the candidates of all serve all.
        """
        number, started = 0, bool(len(self.rows))
        ends: list[np.ndarray] = []
        peers = self.config.optimizer == "adam" or self.config.decompose == "coacd"
        for track in range(1 if peers else 1 + self.config.excursions):
            beginning = RICH_ROUNDS
            if track % 2 and not started:
                beginning = SECOND_RICH
                self.restart()
            elif track:
                self.look()
            status, number = self.run_track(number, beginning)
            ends.append(self.rows)
            self.rows, self.score, self.iou = self.best_rows, self.best_score, self.best_iou
            if status is not Status.SATURATED:
                return status
        if len(ends) > 1:
            self.look()
            return self.run_track(number, (), np.concatenate(ends))[0]
        return Status.SATURATED

    def restart(self) -> None:
        """Begin anew from nothing."""
        self.slabs = True
        self.rows, self.field, self.iou = self.rows[:0], None, 0.0
        self.score = self.assess(self.rows)

    def run_track(
        self, number: int, beginning: tuple[tuple[float, float], ...], others: np.ndarray | None = None
    ) -> tuple[Status, int]:
        """Rounds until one no longer pays; the stop, and the number of the next round.

        Args:
            number: of the first round.
            beginning: price and weight of false volume of the first, rich rounds.
            others: rows of other tracks, on offer in the first round.
        """
        top, since = -np.inf, 0
        while number < self.config.rounds:
            reason = self.reason_to_stop()
            if reason is not None:
                return reason, number
            last = number + 1 == self.config.rounds
            rich = beginning[since] if since < len(beginning) and not last else None
            self.round(number, rich, others if not since else None)
            number, since = number + 1, since + 1
            reason = self.reason_to_stop()
            if reason is not None:
                return reason, number
            if rich is None:
                score = replace_price(self.score, self.config.parsimony, self.alpha).objective
                if score - top <= SATURATION:
                    return Status.SATURATED, number
                top = score
        return Status.ROUNDS, number

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

    def round(self, number: int, rich: tuple[float, float] | None, others: np.ndarray | None = None) -> None:
        """One round; `others` are further candidates.

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
            return
        self.tell("propose", number, 0.15)
        with self.timed("propose"):
            remembered = self.propose(regions, number)
            candidates = remembered if others is None else np.concatenate([others, remembered])
            candidates[:, BLEND] = starting_blends(candidates) if config.union == "smooth" else 0.0
            pool = np.concatenate([self.rows, candidates])
        if self.should_stop():
            return
        self.tell("select", number, 0.5)
        with self.timed("select"):
            chosen = self.choose(pool, len(remembered), false_volume)
        if not chosen:
            return
        self.tell("refine", number, 0.6)
        with self.timed("refine"):
            selected = pool[sorted_by_volume(pool, chosen)]
            refined = self.refine(selected, number, config.refine if rich else config.sharpen)
        with self.timed("prune"):
            if config.union == "smooth":
                refined = choose_blends(self.values(refined), refined, self.tally)
            kept = refined[prune(self.inside(refined), self.tally, self.alpha, self.device)]
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
        self.remember_best()
        self.tell("prune", number, 1.0)

    def cut(self) -> list[Region]:
        """Regions of what is unexplained, and of what the primitives so far hold."""
        config, most = self.config, self.config.propose.regions
        if config.decompose == "coacd":
            return propose_convex_regions(self.target.grid, self.field, most, config.seed)
        regions = propose_regions(
            self.target.grid,
            self.field,
            first_round=not len(self.rows),
            device=self.device,
            blocks=config.propose.blocks,
            slabs=config.propose.slabs and self.slabs,
            holes=config.propose.holes,
            most=most,
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
            samples = with_probes(samples, rows, families, self.target, config.seed + number, self.device)
        return refine(rows, families, samples, settings, self.device, self.should_stop)

    def remember_best(self) -> None:
        """Keep the rows if they beat the best at the full price."""
        score = replace_price(self.score, self.config.parsimony, self.alpha)
        if score.objective > self.best_score.objective:
            self.best_rows, self.best_score, self.best_iou = self.rows, score, self.iou

    def choose(self, pool: np.ndarray, remembered: int, false_volume: float) -> list[int]:
        """Indices into the pool; the primitives so far come first in it and may be swapped out.

        The last `remembered` of it are the memory's.
        """
        if self.config.optimizer == "adam":
            # The paper seeds all regions of a decomposition and lets optimisation and pruning decide.
            return list(range(min(len(pool), self.config.max_primitives)))
        bits = np.concatenate([self.inside(pool[: len(pool) - remembered]), self.memory.bits()])
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
        """Blends and a sharp refinement in turn; kept only where the objective rises."""
        if not len(self.rows):
            return
        self.alpha = self.config.parsimony
        with self.timed("merge"):
            if self.config.optimizer == "levenberg":
                self.merge()
        with self.timed("finish"):
            rows, polish = self.rows, self.config.polish
            for _ in range(polish.passes):
                if self.config.union == "smooth":
                    rows = choose_blends(self.values(rows), rows, self.tally)
                    self.keep_if_better(rows)
                if self.config.optimizer == "levenberg":
                    rows = refine(
                        rows, self.families(rows), self.samples, polish.refine, self.device, self.should_stop
                    )
                    self.keep_if_better(rows)
        self.look()

    def merge(self) -> None:
        """Put one candidate in the place of several parts, refined before it is judged.

        Selection compares what was refined together with candidates as they were fitted, so that it holds on to two
        parts, a shell and its filling say, where one would do.
        """
        tries, settings = self.config.polish.merges, replace(self.config.sharpen, betas=MERGED)
        moves = mergers(self.rows, self.memory, self, tries)
        while moves and tries and not self.should_stop():
            before, tries = self.score, tries - 1
            self.keep_if_better(self.refine(moves.pop(0), len(self.rounds), settings))
            if self.score is not before:
                moves = mergers(self.rows, self.memory, self, tries)

    def keep_if_better(self, rows: np.ndarray) -> None:
        """Take rows, pruned, if they beat those so far."""
        kept = rows[prune(self.inside(rows), self.tally, self.alpha, self.device)]
        score = self.assess(kept)
        if score.objective > self.score.objective:
            self.rows, self.score = kept, score


def starting_blends(rows: np.ndarray) -> np.ndarray:
    """Blends (primitive_count,) of new primitives: thin ones would drown in a wide one."""
    thickness = rows[:, SHAPES : SHAPES + 3].min(1)
    return np.minimum(STARTING_BLEND * thickness, WIDEST_START)


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
