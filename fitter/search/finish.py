"""The finish of a fit: mergers of parts, then blends and a sharp refinement."""

from __future__ import annotations

from dataclasses import replace

from ..refine.joint import refine
from .assess import assess, evaluate_field, keep_if_better, solid_rows
from .context import SearchContext
from .merge import mergers
from .state import SearchState
from .track import with_chosen_blends

MERGED = (40.0, 300.0)
"""Sharpness of the refinement of a merged part and those around it."""

MERGE_STEPS = 12
"""Levenberg steps of it."""


def finish(context: SearchContext, state: SearchState) -> None:
    """Mergers, then the polish."""
    if not len(state.rows):
        return
    state.alpha = state.price
    with state.timed("merge"):
        if not context.refiner.selects:
            merge(context, state)
    polish(context, state)


def polish(context: SearchContext, state: SearchState) -> None:
    """Blends and a sharp refinement in turn; kept only where the objective rises."""
    with state.timed("finish"):
        rows, settings = state.rows, context.config.polish
        for _ in range(settings.passes):
            if context.config.union == "smooth":
                rows = with_chosen_blends(context, state, rows)
                keep_if_better(context, state, rows)
            if not context.refiner.selects:
                families = context.families(rows)
                rows = refine(
                    rows, families, context.samples, settings.refine, context.device, context.should_stop
                )
                keep_if_better(context, state, rows)
        state.rows = solid_rows(context, state, state.rows)
        state.score = assess(context, state, state.rows)
    evaluate_field(context, state)


def merge(context: SearchContext, state: SearchState) -> None:
    """Put one candidate in the place of several parts, refined before it is judged.

    Selection compares what was refined together with candidates as they were fitted, so that it holds on to two
    parts, a shell and its filling say, where one would do.
    """
    config, tries = context.config, context.config.polish.merges
    family = config.primitive
    settings = replace(config.sharpen, betas=MERGED, iterations=MERGE_STEPS)
    moves = mergers(state.rows, state.candidate_pool, family, context.tally, state.alpha, tries)
    while moves and tries and not context.should_stop():
        before, tries = state.score, tries - 1
        seed = config.seed + len(state.rounds)
        keep_if_better(
            context, state, context.refiner.refine(moves.pop(0), settings, seed, context.should_stop)
        )
        if state.score is not before:
            moves = mergers(state.rows, state.candidate_pool, family, context.tally, state.alpha, tries)
