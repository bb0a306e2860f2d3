"""Mirror pairs become alike where that costs nothing."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import warp as wp

from resfit.fitter.config import preset_config
from resfit.fitter.objective.cached import CachedObjective
from resfit.fitter.regularise.mirror_pairs import MOST_FALL, mirror_pairs
from resfit.kernels.primitives import family
from resfit.kernels.rows import BLEND, ROTATION, SHAPES, TRANSLATION, empty_rows
from resfit.shape.target import Target, make_target

BODY, WHEEL, AT = (1.0, 0.4, 0.5), (0.1, 0.4, 0.4), 0.6


def cart(far: float = AT) -> trimesh.Trimesh:
    """A body between two wheels; the second at `far`."""
    body, left, right = (trimesh.creation.box(size) for size in (BODY, WHEEL, WHEEL))
    left.apply_translation((-AT, -0.1, 0.0))
    right.apply_translation((far, -0.1, 0.0))
    return trimesh.util.concatenate([body, left, right])


def rough(target: Target, scale: float, far: float = AT) -> np.ndarray:
    """Its boxes in the target's frame, one wheel a little larger and turned."""
    rows = empty_rows(3)
    boxes = ((BODY, (0.0, 0.0, 0.0)), (WHEEL, (-AT, -0.1, 0.0)), (WHEEL, (far, -0.1, 0.0)))
    for row, (size, place) in zip(rows, boxes, strict=True):
        shape = family("superfrustum").shape_row(size=np.array(size) / scale, roundness=0.0)
        row[SHAPES : SHAPES + len(shape)] = shape
        row[TRANSLATION : TRANSLATION + 3] = target.transform.to_normalised([place])[0]
        row[BLEND] = 0.0
    rows[2, SHAPES : SHAPES + 3] *= 1.004
    turn = np.array([1.0, 0.003, -0.002, 0.001])
    rows[2, ROTATION : ROTATION + 4] = turn / np.linalg.norm(turn)
    return rows


@pytest.fixture
def judged(device: wp.Device) -> tuple[Target, CachedObjective]:
    target = make_target(cart(), device, 64, 4000)
    return target, CachedObjective(target, preset_config("balanced"), device)


def test_the_better_of_two_is_copied(judged: tuple[Target, CachedObjective]) -> None:
    target, cached_objective = judged
    rows = rough(target, target.transform.scale)
    found = mirror_pairs(rows, target, cached_objective)
    (copy,) = found.copies
    assert {copy.source, copy.index} == {1, 2} and np.linalg.det(copy.turn) < 0
    assert cached_objective.objective(found.rows) >= cached_objective.objective(rows) - MOST_FALL
    left, right = found.rows[1], found.rows[2]
    assert np.array_equal(left[SHAPES : SHAPES + 3], right[SHAPES : SHAPES + 3])
    plane = 2.0 * float(target.transform.to_normalised([[0.0, 0.0, 0.0]])[0, 0])
    assert left[0] == pytest.approx(plane - right[0], abs=1e-6)
    assert np.allclose(left[1:3], right[1:3], atol=1e-6)


def test_what_is_not_symmetric_stays(device: wp.Device) -> None:
    target = make_target(cart(0.75), device, 64, 4000)
    cached_objective = CachedObjective(target, preset_config("balanced"), device)
    rows = rough(target, target.transform.scale, 0.75)
    found = mirror_pairs(rows, target, cached_objective)
    # Across z it is symmetric: wheels are set straight, but neither becomes the other.
    assert not found.copies
    assert np.array_equal(found.rows[:, TRANSLATION], rows[:, TRANSLATION])
    assert found.rows[2, SHAPES] != found.rows[1, SHAPES]
