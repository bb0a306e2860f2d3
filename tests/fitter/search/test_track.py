"""One track: rounds on their own, and states that share nothing."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import warp as wp

from resfit.fitter.config import preset_config
from resfit.fitter.outcome import Status
from resfit.fitter.search.assess import assess, begin_search
from resfit.fitter.search.context import SearchContext, search_context
from resfit.fitter.search.finish import finish
from resfit.fitter.search.track import run_round, run_track, starting_blends
from resfit.kernels.rows import SHAPES, empty_rows
from resfit.shape.target import make_target

CROSS = trimesh.util.concatenate(
    [trimesh.creation.box((1.0, 0.2, 0.2)), trimesh.creation.box((0.2, 1.0, 0.2))]
)


@pytest.fixture(scope="module")
def context() -> SearchContext:
    device = wp.get_device("cpu")
    return search_context(
        make_target(CROSS, device, 64, 2000), preset_config("fast", samples=2000, device="cpu"), device
    )


def test_states_share_nothing(context: SearchContext) -> None:
    """A round of one track leaves another as it was, and a second state comes to the same bytes."""
    first, second = begin_search(context), begin_search(context)
    run_round(context, first, 0, None)
    assert len(first.rows) and len(first.rounds) == 1 and first.best.rows is first.rows
    assert not len(second.rows) and not second.rounds and not second.candidate_pool.rows
    assert second.grid_field is None and second.timings == {}
    run_round(context, second, 0, None)
    assert second.rows.tobytes() == first.rows.tobytes() and second.score == first.score


def test_a_track_saturates_and_its_finish_is_worth_no_less(context: SearchContext) -> None:
    state = begin_search(context)
    assert run_track(context, state, 8, ()) is Status.SATURATED
    before = state.score.objective
    finish(context, state)
    assert state.score.objective >= before and state.score == assess(context, state, state.rows)
    assert state.iou > 0.9


def test_a_lower_price_makes_an_assembly_worth_more(context: SearchContext) -> None:
    state = begin_search(context)
    run_round(context, state, 0, None)
    full, count = state.price, len(state.rows)
    before, best = state.score.objective, state.best.score.objective
    state.lower_price(0.5)
    assert state.price == 0.5 * full
    assert np.isclose(state.score.objective - before, 0.5 * full * count)
    assert np.isclose(state.best.score.objective - best, 0.5 * full * count)


def test_thin_primitives_start_with_small_blends() -> None:
    rows = empty_rows(2)
    rows[:, SHAPES : SHAPES + 3] = [(1.0, 1.0, 0.04), (1.0, 1.0, 1.0)]
    assert np.allclose(starting_blends(rows, ["superfrustum"] * len(rows)), [0.01, 0.05])
