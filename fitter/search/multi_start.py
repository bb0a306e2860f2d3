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
from ...kernels.runtime.launch import often_switching, on_cores
from ...shape.target import Target
from ..config import FitConfig
from ..objective.objective import at_price
from ..objective.scoring import rough_volume
from ..outcome import Outcome, Status
from ..progress import Progress
from .assess import begin_search, evaluate_field
from .context import SearchContext, search_context
from .finish import finish
from .proposals import is_baseline, unexplained_parts
from .state import SearchState
from .track import RICH_ROUNDS, SATURATION, run_track

TRACK_SATURATION = 1.2e-2
"""SATURATION in a track that is followed by more: what little it misses, the others find."""

JOINT_SATURATION = 2.5e-3
"""The same where the ends of several tracks are put together."""

SECOND_RICH = ((0.4, 2.0), (0.7, 1.4))
"""RICH_ROUNDS of a second beginning."""

JOINT_RICH = ((0.7, 1.2),)
"""The same where the ends of several tracks are put together."""

REACHED = (Status.TARGET_IOU, Status.TOLERANCE)
"""Stops that the rows of the moment have earned: another set, or a last polish by the objective, may fall short."""

ENDED = (Status.SATURATED, Status.ROUNDS)
"""Ends of a track after which a fit goes on."""

POOR_IOU, POOR_SHARE = 0.85, 0.42
"""Below this IoU a fit goes on with primitives at this share of their price: nobody wants few parts that are a poor
likeness."""

LOOK_AROUND = 0.1
"""Seconds between looks at a track that is waited for."""


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
    context = search_context(target, config, device, on_progress, should_stop)
    return search(context, begin_search(context, start_rows, slabs=config.excursions == 0))


def search(context: SearchContext, state: SearchState) -> Outcome:
    """All rounds, then the blends and a last refinement."""
    status = run_tracks(context, state)
    if status in REACHED:
        state.score = state.full_score()
    else:
        state.take(state.best)
        if not status.stopped_early:
            finish(context, state)
    rows = state.rows
    if context.config.union == "hard":
        rows = rows[np.argsort(-rough_volume(rows, context.families(rows)), kind="stable")]
    score = at_price(state.score, context.config.parsimony, state.price)
    return Outcome(rows, context.families(rows), score, state.iou, status, state.rounds, state.timings)


def run_tracks(context: SearchContext, state: SearchState) -> Status:
    """Tracks until each saturates; then what they found is put together.

    The first two begin from nothing, side by side; later ones go on from the best so far.
    """
    config = context.config
    tracks = 1 if is_baseline(config) else 1 + config.excursions
    limit = int(config.rounds / (tracks + 0.5)) if tracks > 1 else config.rounds
    if limit <= len(RICH_ROUNDS):
        return run_track(context, state, config.rounds)
    saturation = SATURATION if tracks == 1 else TRACK_SATURATION
    if tracks == 1 or len(state.rows):
        status = run_track(context, state, limit, saturation=saturation)
        ends = [state.rows]
    else:
        status, ends = run_two(context, state, limit)
    while status in ENDED and len(ends) < tracks:
        take_best(context, state)
        state.slabs = True
        status = run_track(context, state, limit, saturation=saturation)
        ends.append(state.rows)
    if status in ENDED and len(ends) > 1:
        take_best(context, state)
        saturation = JOINT_SATURATION
        left = max(1, config.rounds - len(state.rounds))
        status = run_track(context, state, left, JOINT_RICH, saturation, np.concatenate(ends))
    left = config.rounds - len(state.rounds)
    if status is Status.SATURATED and 0 < state.best.iou < POOR_IOU and left > 0:
        take_best(context, state)
        state.lower_price(POOR_SHARE)
        status = run_track(context, state, left, RICH_ROUNDS[-1:], saturation)
    return status


def take_best(context: SearchContext, state: SearchState) -> None:
    """Go on from the best so far."""
    state.take(state.best)
    evaluate_field(context, state)


def run_two(context: SearchContext, state: SearchState, limit: int) -> tuple[Status, list[np.ndarray]]:
    """A track and a second one side by side, on a core one after the other; the same bytes either way.

    Args:
        context: of the fit.
        state: of the first track, before its first round; it takes over what both come to.
        limit: of rounds in each.

    Returns:
        How the first ended, or the second if only that reached what was asked for, and the rows of both.
    """
    with state.timed("decompose"):
        state.beginning = unexplained_parts(context, state, slabs=True)
    second = begin_search(context, slabs=True, beginning=state.beginning)
    aside = replace(context, progress=context.progress.silent_track())
    if not context.device.is_cpu or core_count() == 1:
        status = run_track(context, state, limit, saturation=TRACK_SATURATION)
        if status not in ENDED:
            return status, [state.rows]
        second.timings = state.timings
        return join(state, status, second, run_track(aside, second, limit, SECOND_RICH, TRACK_SATURATION))
    halt, cores = threading.Event(), core_count() // 2
    aside = replace(aside, interrupted=halt.is_set)

    def run_second() -> Status:
        with on_cores(cores):
            return run_track(aside, second, limit, SECOND_RICH, TRACK_SATURATION)

    with often_switching(), ThreadPoolExecutor(1, thread_name_prefix="resfit-track") as pool:
        other = pool.submit(run_second)
        try:
            with on_cores(core_count() - cores):
                status = run_track(context, state, limit, saturation=TRACK_SATURATION)
            if status in ENDED:
                with state.timed("wait"):
                    wait_for(context, state, other, halt)
        finally:
            halt.set()
    if status in REACHED or status is Status.MAX_PRIMITIVES:
        return status, [state.rows]
    return join(state, status, second, other.result())


def wait_for(
    context: SearchContext, state: SearchState, other: Future[Status], halt: threading.Event
) -> None:
    """Wait for another track, and stop it once the fit is to stop."""
    while not wait([other], LOOK_AROUND).done:
        context.progress.tell(state, "refine", len(state.rounds), 0.0)
        if context.should_stop():
            halt.set()


def join(
    state: SearchState, status: Status, second: SearchState, ended: Status
) -> tuple[Status, list[np.ndarray]]:
    """Take over what a second track came to; `status` and `ended` are how the tracks stopped."""
    ends = [state.rows, second.rows]
    state.rounds += second.rounds
    state.candidate_pool.take(second.candidate_pool)
    if second.best.score.objective > state.best.score.objective:
        state.best = second.best
    if ended in REACHED and status in ENDED:
        state.rows, state.score, state.iou, state.alpha = second.rows, second.score, second.iou, second.alpha
    return (status if ended in ENDED else ended), ends
