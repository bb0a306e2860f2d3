"""Several tracks: the same bytes on any number of cores, the limit of rounds, and stops in the middle of one."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from voxel_solids import propose_regions

from resfit.decomposition import propose
from resfit.decomposition.proposals import proposals_for
from resfit.fitter.config import preset_config
from resfit.fitter.outcome import Status
from resfit.fitter.search import multi_start, proposals
from resfit.fitter.search.assess import assess, begin_search
from resfit.fitter.search.context import SearchContext, search_context
from resfit.fitter.search.multi_start import fit_target, search
from resfit.fitter.search.state import SearchState
from resfit.kernels.rows import SHAPES
from resfit.shape.target import make_target


@pytest.fixture(scope="module")
def stool():
    """A seat on three round legs with a ring between them: four bodies and a torus."""
    angles = np.array([0.0, 2.1, 4.2])
    legs = [
        trimesh.creation.cylinder(
            0.06,
            0.8,
            transform=trimesh.transformations.translation_matrix([0.4 * np.cos(a), 0.4 * np.sin(a), 0.4]),
        )
        for a in angles
    ]
    seat = trimesh.creation.cylinder(
        0.55, 0.1, transform=trimesh.transformations.translation_matrix([0, 0, 0.83])
    )
    ring = trimesh.creation.torus(0.4, 0.04)
    ring.apply_translation([0, 0, 0.3])
    return trimesh.util.concatenate([*legs, seat, ring])


def two_tracks(**options):
    return preset_config("fast", excursions=1, **({"rounds": 12} | options))


def test_two_tracks_give_the_same_bytes_on_one_core_and_on_more(stool, device, monkeypatch):
    target, found = make_target(stool, device), []
    for cores in (1, 2, 3):
        monkeypatch.setenv("RESFIT_THREADS", str(cores))
        outcome = fit_target(target, two_tracks(), device)
        found.append((outcome.rows.tobytes(), [entry.score for entry in outcome.rounds]))
    assert found[0] == found[1] == found[2]
    assert outcome.status is Status.SATURATED and outcome.iou > 0.9
    assert len(outcome.rounds) > 6, "both tracks are in the story"


def test_what_tracks_found_is_put_together(stool, device, monkeypatch):
    """The result is worth no less than the end of any track, and the ends are on offer when all are joined."""
    ends: list[np.ndarray] = []
    run_two = multi_start.run_two

    def watch(context: SearchContext, state: SearchState, limit: int):
        status, found = run_two(context, state, limit)
        ends.extend(found)
        return status, found

    monkeypatch.setattr(multi_start, "run_two", watch)
    context = search_context(make_target(stool, device), two_tracks(), device)
    state = begin_search(context, slabs=False)
    outcome = search(context, state)
    assert len(ends) == 2
    for end in ends:
        assert outcome.score.objective >= assess(context, state, end).objective - 1e-6
        offered = {row.tobytes() for entry in state.rounds for row in entry.candidates[:, :SHAPES]}
        assert all(row.tobytes() in offered for row in end[:, :SHAPES])


def test_two_tracks_begin_with_one_decomposition(stool, device, monkeypatch):
    """The target is taken apart once; the first track leaves its slabs out, the second does not."""
    begun = []
    find_all = propose.find_parts

    def watch(target, explained, **options):
        begun.append(explained is None)
        return find_all(target, explained, **options)

    monkeypatch.setattr(proposals, "find_parts", watch)
    monkeypatch.setenv("RESFIT_THREADS", "1")
    target, config = make_target(stool, device), two_tracks()
    outcome = fit_target(target, config, device)
    assert begun.count(True) == 1
    wanted = [
        propose_regions(
            target.grid,
            first_round=True,
            device=device,
            proposals=proposals_for("msd", bulky=slabs),
            most=config.propose.regions,
        )
        for slabs in (False, True)
    ]
    first = [entry.regions for entry in outcome.rounds if entry.regions[0]["source"] == "solid"]
    assert first == [[region.describe() for region in regions] for regions in wanted]
    assert first[0] != first[1]


@pytest.mark.parametrize("rounds", [1, 4, 9])
def test_rounds_are_limited_in_all(stool, device, rounds):
    outcome = fit_target(make_target(stool, device), two_tracks(rounds=rounds), device)
    assert 1 <= len(outcome.rounds) <= rounds
    assert len(outcome.rows)


@pytest.mark.parametrize("cores", ["1", "2"])
def test_an_interrupt_keeps_the_best(stool, device, cores, monkeypatch):
    """Asked to stop somewhere in the rounds, a fit comes back with what it has."""
    monkeypatch.setenv("RESFIT_THREADS", cores)
    seen = []

    def stop() -> bool:
        return len(seen) > 12

    outcome = fit_target(make_target(stool, device), two_tracks(), device, seen.append, stop)
    assert outcome.status is Status.INTERRUPTED
    assert len(outcome.rows) and outcome.score.objective > 0
    fractions = [progress.fraction for progress in seen]
    assert fractions == sorted(fractions), "progress never goes back"


def test_a_goal_ends_all_tracks(stool, device, monkeypatch):
    monkeypatch.setenv("RESFIT_THREADS", "2")
    outcome = fit_target(make_target(stool, device), two_tracks(target_iou=0.7), device)
    assert outcome.status is Status.TARGET_IOU and outcome.iou >= 0.7
