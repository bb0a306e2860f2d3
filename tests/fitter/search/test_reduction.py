"""Assemblies of fewer parts: the best so few, not the others cut off."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import warp as wp

import resfit
from resfit.fitter.config import preset_config
from resfit.fitter.objective.cached import CachedObjective
from resfit.fitter.outcome import Status
from resfit.fitter.search.pareto import remove_down_to
from resfit.fitter.search.reduction import Reduction
from resfit.kernels.primitives import family
from resfit.kernels.rows import SHAPE, SHAPES, TRANSLATION, empty_rows
from resfit.shape.target import Target, make_target

FAST = preset_config("fast", device="cpu")


def blocks() -> trimesh.Trimesh:
    """A long box and a cube apart from it."""
    long = trimesh.creation.box((4.0, 1.0, 1.0))
    cube = trimesh.creation.box((1.0, 1.0, 1.0))
    cube.apply_translation((0.0, 0.0, 2.0))
    return trimesh.util.concatenate([long, cube])


def three_rows(target: Target) -> np.ndarray:
    """The halves of the long box, and the cube."""
    rows = empty_rows(3)
    places = np.array([(-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 2.0)])
    rows[:, TRANSLATION : TRANSLATION + 3] = target.transform.to_normalised(places)
    for row, length in zip(rows, (2.0, 2.0, 1.0), strict=True):
        size = np.array((length, 1.0, 1.0)) / target.transform.scale
        row[SHAPES : SHAPES + SHAPE] = family("superfrustum").shape_row(size=size)
    return rows


@pytest.fixture(scope="module")
def target() -> Target:
    return make_target(blocks(), wp.get_device("cpu"), sample_count=2048)


def test_one_part_takes_the_place_of_two(target: Target) -> None:
    device, rows = wp.get_device("cpu"), three_rows(target)
    cached_objective = CachedObjective(target, FAST, device)
    cut = rows[remove_down_to(cached_objective.values(rows), cached_objective, 2)]
    reduction = Reduction(rows, target, FAST, device)
    reduction.step()
    assert len(reduction.rows) == 2
    before = reduction.rows
    best = reduction.improved(2)
    assert len(best) == 2 and cached_objective.objective(best) >= cached_objective.objective(before)
    assert cached_objective.score(best).recovery > 0.95 > 0.9 > cached_objective.score(cut).recovery
    # What is found for one number leaves no trace in what is found for another.
    assert reduction.rows is before and reduction.improved(2).tobytes() == best.tobytes()


def test_the_time_is_up(target: Target) -> None:
    """Then parts are only removed."""
    rows = three_rows(target)
    reduction = Reduction(rows, target, FAST, wp.get_device("cpu"), lambda: True)
    reduction.step()
    best = reduction.improved(2)
    assert len(best) == 2 and {row.tobytes() for row in best} <= {row.tobytes() for row in rows}


def test_as_many_parts_as_are_allowed() -> None:
    mesh = blocks()
    plain = resfit.fit(mesh, preset="fast", device="cpu")
    enough = resfit.fit(mesh, preset="fast", device="cpu", max_primitives=len(plain.gains))
    assert enough.assembly.rows().tobytes() == plain.assembly.rows().tobytes() and not enough.notes
    one = resfit.fit(mesh, preset="fast", device="cpu", max_primitives=1)
    assert len(one.assembly.primitives) == 1 and one.status is Status.MAX_PRIMITIVES
    assert f"The best part in place of {len(plain.gains)}" in one.notes[-1]


@pytest.mark.slow
def test_a_cart_keeps_its_wheels() -> None:
    """Six parts are a body, a cabin and four wheels, however many the fit came to."""
    wheels = [
        trimesh.creation.cylinder(0.6, 0.4, transform=np.c_[np.eye(4)[:, [0, 2, 1]], (x, y, 0.0, 1.0)])
        for x in (-1.4, 1.4)
        for y in (-1.0, 1.0)
    ]
    body, cabin = trimesh.creation.box((4.0, 1.4, 1.0)), trimesh.creation.box((1.2, 1.2, 1.4))
    body.apply_translation((0.0, 0.0, 0.6))
    cabin.apply_translation((-1.0, 0.0, 1.7))
    rail = trimesh.creation.box((0.3, 3.0, 0.3))
    rail.apply_translation((2.1, 0.0, 0.9))
    result = resfit.fit(
        trimesh.util.concatenate([*wheels, body, cabin, rail]), preset="fast", device="cpu", max_primitives=6
    )
    assert len(result.assembly.primitives) == 6 and result.metrics["iou"] > 0.9
    held = result.assembly.transform.to_mesh(result.assembly.rows()[:, TRANSLATION : TRANSLATION + 3])
    for x in (-1.4, 1.4):
        for y in (-1.0, 1.0):
            assert np.linalg.norm(held - (x, y, 0.0), axis=1).min() < 0.4


def test_what_cuts_a_reduction_short_is_said() -> None:
    told: list[str] = []
    result = resfit.fit(
        blocks(),
        preset="fast",
        device="cpu",
        max_primitives=1,
        on_progress=lambda progress: told.append(progress.stage),
        should_stop=lambda: "reduce" in told,
    )
    assert result.status is Status.INTERRUPTED and result.status.stopped_early
    assert len(result.assembly.primitives) == 1
