"""A track of a fit: rounds from one beginning until they no longer pay.

A round decomposes what is unexplained, proposes, selects, refines and prunes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...kernels.field.bounds import extents
from ...kernels.rows import BLEND
from ...kernels.runtime.launch import serial_device
from ..objective.scoring import choose_blends, sorted_by_volume
from ..outcome import Round, Status
from .assess import assess, evaluate_field, pruned
from .context import SearchContext
from .proposals import cut, proposals_of
from .state import SearchState

SATURATION = 1e-3
"""A round that raises the objective by less than this is the last."""

RICH_ROUNDS = ((0.3, 2.5), (0.5, 2.0), (0.75, 1.4))
"""Price of a primitive, as a share of the full one, and weight of false volume in the first rounds. An assembly that
is rich and precise at first finds what belongs together; one that is poor and bulky at first stays so (a plate with
pockets as one box)."""

THOROUGH = 2
"""Excursions from which a fit with as many parts as are allowed goes on: it exchanges them for better ones."""

STARTING_BLEND = 0.25
"""Blend of a new primitive, as a share of its thickness, until one is chosen for it."""

WIDEST_START = 0.05
"""The same at most, normalised units."""


def run_track(
    context: SearchContext,
    state: SearchState,
    limit: int,
    beginning: tuple[tuple[float, float], ...] = RICH_ROUNDS,
    saturation: float = SATURATION,
    others: np.ndarray | None = None,
) -> Status:
    """Rounds until one no longer pays.

    Args:
        context, state: of the track.
        limit: of rounds.
        beginning: price and weight of false volume of the first, rich rounds.
        saturation: least rise of the objective in a round that is not the last.
        others: rows of other tracks, on offer in the first round.
    """
    top, first = -np.inf, len(state.rounds)
    for since in range(limit):
        reason = reason_to_stop(context, state)
        if reason is not None:
            return reason
        rich = beginning[since] if since < len(beginning) and since + 1 < limit else None
        run_round(context, state, first + since, rich, others if not since else None)
        reason = reason_to_stop(context, state)
        if reason is not None:
            return reason
        if rich is None:
            objective = state.full_score().objective
            if objective - top <= saturation:
                return Status.SATURATED
            top = objective
    return Status.ROUNDS


def reason_to_stop(context: SearchContext, state: SearchState) -> Status | None:
    """The stop that holds now, if any."""
    config = context.config
    if context.interrupted():
        return Status.INTERRUPTED
    if context.out_of_time():
        return Status.TIMEOUT
    if state.iou >= config.target_iou and config.target_iou < 1.0:
        return Status.TARGET_IOU
    if len(state.rows) and config.tolerance > 0:
        with state.timed("tolerance"):
            deviation = context.deviation(state.rows)
        if deviation <= config.tolerance:
            return Status.TOLERANCE
    if len(state.rows) >= config.max_primitives and config.excursions < THOROUGH:
        return Status.MAX_PRIMITIVES
    return None


def run_round(
    context: SearchContext,
    state: SearchState,
    number: int,
    rich: tuple[float, float] | None,
    others: np.ndarray | None = None,
) -> None:
    """One round; `others` are further candidates.

    A rich round, given its share of the price and its weight of false volume, is gone on from whatever it comes
    to; a plain one only if the objective rises.
    """
    config, progress, proposals = context.config, context.progress, proposals_of(context)
    share, false_volume = rich or (1.0, 1.0)
    state.alpha = state.price * share
    state.score = assess(context, state, state.rows)
    progress.tell(state, "decompose", number, 0.0)
    with state.timed("decompose"):
        regions = cut(context, state)
    if not regions or context.should_stop():
        return
    progress.tell(state, "propose", number, 0.15)
    with state.timed("propose"):
        remembered = proposals.candidates(context, state, regions, number)
        candidates = remembered if others is None else np.concatenate([remembered, others])
        blends = starting_blends(candidates, context.families(candidates))
        candidates[:, BLEND] = blends if config.union == "smooth" else 0.0
        pool = np.concatenate([candidates, state.rows])
    if context.should_stop():
        return
    progress.tell(state, "select", number, 0.5)
    with state.timed("select"):
        chosen = proposals.choose(context, state, pool, len(candidates), false_volume)
    if not chosen:
        return
    progress.tell(state, "refine", number, 0.6)
    with state.timed("refine"):
        selected = pool[sorted_by_volume(pool, context.families(pool), chosen)]
        settings = config.refine if rich else config.sharpen
        refined = context.refiner.refine(selected, settings, config.seed + number, context.should_stop)
    with state.timed("prune"):
        refined = with_chosen_blends(context, state, refined)
        kept, score = pruned(context, state, refined)
    accepted = rich is not None or score.objective > state.score.objective
    described = [region.describe() for region in regions]
    state.rounds.append(Round(described, candidates, selected, refined, kept, score, accepted))
    if accepted:
        state.rows, state.score = kept, score
        evaluate_field(context, state)
    state.remember_best()
    progress.tell(state, "prune", number, 1.0)


def with_chosen_blends(context: SearchContext, state: SearchState, rows: np.ndarray) -> np.ndarray:
    """Rows with the blends that score best; as they are in a fit without blends."""
    if context.config.union == "hard":
        return rows
    return choose_blends(state.distances.values(rows), rows, context.tally, serial_device())


def starting_blends(rows: np.ndarray, families: Sequence[str]) -> np.ndarray:
    """Blends (primitive_count,) of new primitives: thin ones would drown in a wide one."""
    thickness = extents(rows, families).min(1)
    return np.minimum(STARTING_BLEND * thickness, WIDEST_START)
