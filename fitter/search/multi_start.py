"""Residual Primitive Fitting: decompose what is unexplained, propose, select, refine, prune, and again.

A greedy search ends where its beginning leads it. Two tracks of rounds begin differently, each on its share of the
cores; what they found is then put together, merged and refined once more.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import replace

import numpy as np
import warp as wp

from ...kernels.runtime.cores import core_count
from ...kernels.runtime.launch import often_switching, on_cores, serial_device
from ...shape.target import Target
from ..config import FitConfig
from ..objective.objective import at_price
from ..objective.scoring import choose_blends, rough_volume
from ..outcome import Outcome, Status
from ..progress import Progress
from ..refine.joint import refine
from .merge import mergers
from .search import (
    JOINT_RICH,
    JOINT_SATURATION,
    RICH_ROUNDS,
    SATURATION,
    SECOND_RICH,
    TRACK_SATURATION,
    Search,
)

MERGED = (40.0, 300.0)
"""Sharpness of the refinement of a merged part and those around it."""

MERGE_STEPS = 12
"""Levenberg steps of it."""

REACHED = (Status.TARGET_IOU, Status.TOLERANCE)
"""Stops that the rows of the moment have earned: another set, or a last polish by the objective, may fall short."""

ENDED = (Status.SATURATED, Status.ROUNDS)
"""Ends of a track after which a fit goes on."""

POOR_IOU, POOR_SHARE = 0.85, 0.42
"""Below this IoU a fit goes on with primitives at this share of their price."""

LOOK_AROUND = 0.1
"""Seconds between looks at a track that is waited for."""


class MultiStart(Search):
    """All tracks of a fit, and what comes after them."""

    def run(self) -> Outcome:
        """All rounds, then the blends and a last refinement."""
        status = self.run_tracks()
        if status in REACHED:
            self.score = at_price(self.score, self.price, self.alpha)
        else:
            self.rows, self.score, self.iou = self.best_rows, self.best_score, self.best_iou
            if not status.stopped_early:
                self.finish()
        self.score = at_price(self.score, self.config.parsimony, self.price)
        order = (
            np.argsort(-rough_volume(self.rows, self.families(self.rows)), kind="stable")
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
        """Tracks until each saturates; then what they found is put together.

        The first two begin from nothing, side by side; later ones go on from the best so far.
        """
        config = self.config
        peers = config.optimizer == "adam" or config.decompose == "coacd"
        tracks = 1 if peers else 1 + config.excursions
        limit = int(config.rounds / (tracks + 0.5)) if tracks > 1 else config.rounds
        if limit <= len(RICH_ROUNDS):
            return self.run_track(config.rounds, RICH_ROUNDS)
        self.saturation = SATURATION if tracks == 1 else TRACK_SATURATION
        if tracks == 1 or len(self.rows):
            status, ends = self.run_track(limit, RICH_ROUNDS), [self.rows]
        else:
            status, ends = self.run_two(limit)
        while status in ENDED and len(ends) < tracks:
            self.take_best()
            self.slabs = True
            status = self.run_track(limit, RICH_ROUNDS)
            ends.append(self.rows)
        if status in ENDED and len(ends) > 1:
            self.take_best()
            self.saturation = JOINT_SATURATION
            left = max(1, config.rounds - len(self.rounds))
            status = self.run_track(left, JOINT_RICH, np.concatenate(ends))
        left = config.rounds - len(self.rounds)
        if status is Status.SATURATED and 0 < self.best_iou < POOR_IOU and left > 0:
            self.take_best()
            self.lower_price()
            status = self.run_track(left, RICH_ROUNDS[-1:])
        return status

    def lower_price(self) -> None:
        """Go on with cheaper primitives: nobody wants few parts that are a poor likeness."""
        before, self.price = self.price, POOR_SHARE * self.price
        self.score = at_price(self.score, self.price, before)
        self.best_score = at_price(self.best_score, self.price, before)

    def take_best(self) -> None:
        """Go on from the best so far."""
        self.rows, self.score, self.iou = self.best_rows, self.best_score, self.best_iou
        self.look()

    def run_two(self, limit: int) -> tuple[Status, list[np.ndarray]]:
        """This track and a second one side by side, on a core one after the other; the same bytes either way.

        Returns:
            How the first ended, or the second if only that reached what was asked for, and the rows of both.
        """
        with self.timed("decompose"):
            self.beginning = self.find_parts(slabs=True)
        halt = threading.Event()
        second = self.branch(halt.is_set)
        if not self.device.is_cpu or core_count() == 1:
            status = self.run_track(limit, RICH_ROUNDS)
            if status not in ENDED:
                return status, [self.rows]
            second.interrupted, second.timings = self.interrupted, self.timings
            return self.join(status, second, second.run_track(limit, SECOND_RICH))
        cores = core_count() // 2

        def run_second() -> Status:
            with on_cores(cores):
                return second.run_track(limit, SECOND_RICH)

        with often_switching(), ThreadPoolExecutor(1, thread_name_prefix="resfit-track") as pool:
            other = pool.submit(run_second)
            try:
                with on_cores(core_count() - cores):
                    status = self.run_track(limit, RICH_ROUNDS)
                if status in ENDED:
                    with self.timed("wait"):
                        self.wait_for(other, halt)
            finally:
                halt.set()
        if status in REACHED or status is Status.MAX_PRIMITIVES:
            return status, [self.rows]
        return self.join(status, second, other.result())

    def wait_for(self, other: Future[Status], halt: threading.Event) -> None:
        """Wait for another track, and stop it once the fit is to stop."""
        while not wait([other], LOOK_AROUND).done:
            self.tell("refine", len(self.rounds), 0.0)
            if self.should_stop():
                halt.set()

    def join(self, status: Status, second: Search, ended: Status) -> tuple[Status, list[np.ndarray]]:
        """Take over what a second track came to."""
        ends = [self.rows, second.rows]
        self.rounds += second.rounds
        self.candidate_pool.take(second.candidate_pool)
        if second.best_score.objective > self.best_score.objective:
            self.best_rows, self.best_score, self.best_iou = (
                second.best_rows,
                second.best_score,
                second.best_iou,
            )
        if ended in REACHED and status in ENDED:
            self.rows, self.score, self.iou, self.alpha = second.rows, second.score, second.iou, second.alpha
        return (status if ended in ENDED else ended), ends

    def finish(self) -> None:
        """Mergers, then the polish."""
        if not len(self.rows):
            return
        self.alpha = self.price
        with self.timed("merge"):
            if self.config.optimizer == "levenberg":
                self.merge()
        self.polish()

    def polish(self) -> None:
        """Blends and a sharp refinement in turn; kept only where the objective rises."""
        with self.timed("finish"):
            rows, polish = self.rows, self.config.polish
            for _ in range(polish.passes):
                if self.config.union == "smooth":
                    rows = choose_blends(self.values(rows), rows, self.tally, serial_device())
                    self.keep_if_better(rows)
                if self.config.optimizer == "levenberg":
                    rows = refine(
                        rows, self.families(rows), self.samples, polish.refine, self.device, self.should_stop
                    )
                    self.keep_if_better(rows)
            self.rows = self.solid_rows(self.rows)
            self.score = self.assess(self.rows)
        self.look()

    def merge(self) -> None:
        """Put one candidate in the place of several parts, refined before it is judged.

        Selection compares what was refined together with candidates as they were fitted, so that it holds on to two
        parts, a shell and its filling say, where one would do.
        """
        tries, settings = (
            self.config.polish.merges,
            replace(self.config.sharpen, betas=MERGED, iterations=MERGE_STEPS),
        )
        moves = mergers(self.rows, self.candidate_pool, self, tries)
        while moves and tries and not self.should_stop():
            before, tries = self.score, tries - 1
            self.keep_if_better(self.refine(moves.pop(0), len(self.rounds), settings))
            if self.score is not before:
                moves = mergers(self.rows, self.candidate_pool, self, tries)

    def keep_if_better(self, rows: np.ndarray) -> None:
        """Take rows, pruned, if they beat those so far."""
        kept, score = self.pruned(rows)
        if score.objective > self.score.objective:
            self.rows, self.score = kept, score


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
    return MultiStart(target, config, device, on_progress, should_stop, start_rows).run()
