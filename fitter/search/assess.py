"""Assessment of assemblies in a search: their objective, field and errors, and which primitives do not pay."""

from __future__ import annotations

import numpy as np

from ...decomposition.region import Region
from ...kernels.field.combine import fold
from ...kernels.rows import BLEND, ROW
from ...kernels.runtime.launch import serial_device
from ...kernels.select.coverage_sets import hold
from ..objective.cached import DistanceCache
from ..objective.objective import Score
from ..objective.scoring import score_values
from ..propose.candidate_pool import CandidatePool
from ..select.selection import prune, without_air
from .context import SearchContext
from .state import Incumbent, SearchState

MOST_KNOWN = 128
"""Distances of primitives kept in a track: most assemblies that are compared have half as many."""


def begin_search(
    context: SearchContext,
    rows: np.ndarray | None = None,
    slabs: bool = True,
    beginning: list[Region] | None = None,
) -> SearchState:
    """The state of a track before its first round.

    Args:
        context: of the fit.
        rows: (primitive_count, ROW) to begin with; none unless given.
        slabs, beginning: as in `SearchState`.
    """
    rows = np.zeros((0, ROW), np.float32) if rows is None else rows.astype(np.float32)
    distances = DistanceCache(context.blocks, context.config.primitive, context.device, MOST_KNOWN)
    alpha = context.config.parsimony
    score = score_values(distances.values(rows), rows[:, BLEND], context.tally, alpha)
    candidate_pool = CandidatePool(context.inside, len(context.samples.points), context.device)
    best = Incumbent(rows, score, 0.0)
    state = SearchState(
        rows, score, alpha, alpha, best, candidate_pool, distances, slabs, beginning=beginning
    )
    if len(rows):
        evaluate_field(context, state)
        state.best = Incumbent(rows, score, state.iou)
    return state


def assess(context: SearchContext, state: SearchState, rows: np.ndarray) -> Score:
    """The objective of rows as they are, blends included, at the price of the moment."""
    return score_values(state.distances.values(rows), rows[:, BLEND], context.tally, state.alpha)


def pruned(context: SearchContext, state: SearchState, rows: np.ndarray) -> tuple[np.ndarray, Score]:
    """Rows without the primitives that do not pay, and their score."""
    kept = rows[prune(hold(state.distances.values(rows) < 0, serial_device()), context.tally, state.alpha)]
    return kept, assess(context, state, kept)


def solid_rows(context: SearchContext, state: SearchState, rows: np.ndarray) -> np.ndarray:
    """Rows without those that hold more air than solid."""
    return rows[without_air(hold(state.distances.values(rows) < 0, serial_device()), context.tally)]


def keep_if_better(context: SearchContext, state: SearchState, rows: np.ndarray) -> None:
    """Take rows, pruned, if they beat those of the moment."""
    kept, score = pruned(context, state, rows)
    if score.objective > state.score.objective:
        state.rows, state.score = kept, score


def evaluate_field(context: SearchContext, state: SearchState) -> None:
    """Bring the field on the target's grid and the IoU up to date with the rows."""
    with state.timed("field"):
        state.grid_field, state.iou = context.grid.field_and_iou(context.primitives(state.rows))


def errors(context: SearchContext, state: SearchState) -> np.ndarray:
    """Weight of the wrong samples that each primitive answers for, (primitive_count,)."""
    values, samples = state.distances.values(state.rows), context.samples
    wrong = (fold(values, state.rows[:, BLEND]) < 0) != samples.inside
    owners = values[:, wrong].argmin(0)
    return np.bincount(owners, samples.weight[wrong], minlength=len(state.rows))
