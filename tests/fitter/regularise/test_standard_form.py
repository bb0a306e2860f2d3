"""Standard forms: the same solids, with numbers that mean nothing gone and the smallest rotation."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import warp as wp
from scipy.spatial.transform import Rotation

from resfit.fitter.config import preset_config
from resfit.fitter.objective.cached import CachedObjective
from resfit.fitter.regularise.standard_form import _plainest_pose, _without_extent, standard_forms
from resfit.kernels.field.evaluate import evaluate_primitives
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.primitives import FAMILIES, family
from resfit.kernels.rows import ROTATION, SHAPES, empty_rows
from resfit.shape.target import make_target


def row_of(name: str, quaternion: np.ndarray, **shape: object) -> np.ndarray:
    row = empty_rows(1)[0]
    row[ROTATION : ROTATION + 4] = quaternion
    values = family(name).shape_row(**shape)
    row[SHAPES : SHAPES + len(values)] = values
    return row


def turn(rng: np.random.Generator) -> np.ndarray:
    return Rotation.random(random_state=int(rng.integers(1 << 30))).as_quat()[[3, 0, 1, 2]]


def field(row: np.ndarray, name: str, points: np.ndarray, device: wp.Device) -> np.ndarray:
    return evaluate_primitives(PrimitiveSet(row[None], [name], device), points)[0]


def angle(row: np.ndarray) -> float:
    return 2.0 * float(np.arccos(min(1.0, abs(row[ROTATION]))))


SOLIDS = {
    "box": {"size": (0.5, 0.9, 1.3)},
    "square prism": {"size": (0.5, 0.5, 1.3), "roundness": 0.4},
    "cylinder": {"size": (0.6, 0.6, 1.1), "roundness": 1.0},
    "cone": {"size": (0.6, 0.6, 1.1), "roundness": 1.0, "taper": 0.3},
    "pyramid": {"size": (0.6, 0.9, 1.1), "taper": 0.3},
    "tube": {"size": (0.6, 0.6, 1.1), "roundness": 1.0, "onion": 0.5},
    "bent bar": {"size": (0.3, 0.4, 1.1), "bulge": 0.5},
    "ball": {"size": (0.0, 0.0, 0.0), "roundness": 1.0, "dilation": 0.6},
    "capsule": {"size": (0.0, 0.0, 0.7), "roundness": 1.0, "dilation": 0.3},
}


@pytest.mark.parametrize("name", SOLIDS)
def test_the_plainest_pose_is_the_same_solid(name: str, rng: np.random.Generator, device: wp.Device) -> None:
    points = rng.uniform(-1.0, 1.0, (500, 3)).astype(np.float32)
    plain = empty_rows(1)[0]
    for _ in range(10):
        row = row_of("superfrustum", turn(rng), **SOLIDS[name])
        plain = _plainest_pose(row, "superfrustum")
        before, after = (field(entry, "superfrustum", points, device) for entry in (row, plain))
        np.testing.assert_allclose(after, before, atol=2e-5)
        assert angle(plain) <= angle(row) + 1e-5
    assert name != "ball" or angle(plain) == 0.0


@pytest.mark.parametrize("name", FAMILIES)
def test_poses_of_all_families_keep_their_solids(
    name: str, rng: np.random.Generator, device: wp.Device
) -> None:
    points = rng.uniform(-1.0, 1.0, (500, 3)).astype(np.float32)
    low, high = family(name).fit_range
    for _ in range(20):
        row = row_of(name, turn(rng), size=rng.uniform(0.2, 1.0, 3))
        row[SHAPES + 3 : SHAPES + len(low)] = rng.uniform(low[3:], np.minimum(high[3:], 1.0))
        plain = _plainest_pose(row, name)
        before, after = (field(entry, name, points, device) for entry in (row, plain))
        np.testing.assert_allclose(after, before, atol=1e-4)


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        ({"size": (2e-3, 1e-3, 2e-3), "dilation": 0.6, "taper": 0.8, "bulge": 0.3}, (0.0, 0.0, 0.0)),
        ({"size": (1e-3, 0.8, 2e-3), "dilation": 0.3, "taper": 0.9, "roundness": 0.4}, (0.0, 0.0, 0.7985)),
    ],
)
def test_balls_and_capsules(shape: dict, expected: tuple[float, ...], rng: np.random.Generator) -> None:
    row = _without_extent(row_of("superfrustum", turn(rng), **shape), "superfrustum")
    assert row[SHAPES : SHAPES + 3] == pytest.approx(expected, abs=1e-3)
    entry = family("superfrustum")
    found = {name: float(row[SHAPES + entry.columns(name).start]) for name in ("taper", "bulge", "roundness")}
    assert found == {"taper": 1.0, "bulge": 0.0, "roundness": 1.0}


def test_a_ring_has_no_wall(rng: np.random.Generator, device: wp.Device) -> None:
    row = row_of("superfrustum", turn(rng), size=(1.0, 1.0, 1e-3), roundness=1.0, dilation=0.2, onion=0.998)
    bare = _without_extent(row, "superfrustum")
    assert bare[SHAPES + family("superfrustum").columns("onion").start] == 1.0
    points = rng.uniform(-1.0, 1.0, (500, 3)).astype(np.float32)
    before, after = (field(entry, "superfrustum", points, device) for entry in (row, bare))
    np.testing.assert_allclose(after, before, atol=2e-3)


def test_what_would_cost_stays(device: wp.Device) -> None:
    target = make_target(trimesh.creation.box((1.0, 1.4, 1.8)), device, 64)
    config = preset_config("fast")
    cached_objective = CachedObjective(target, config, device)
    tapered = row_of("superfrustum", np.array([1.0, 0, 0, 0]), size=(1.0, 1.4, 1.8), taper=0.986)
    box = row_of("superfrustum", np.array([1.0, 0, 0, 0]), size=(1.0, 1.4, 1.8), taper=0.7)
    rows = standard_forms(np.stack([tapered, box]), cached_objective)
    taper = SHAPES + family("superfrustum").columns("taper").start
    assert rows[1, taper] == np.float32(0.7)
    assert cached_objective.objective(rows) >= cached_objective.objective(np.stack([tapered, box])) - 1e-3
    assert len(standard_forms(rows[:0], cached_objective)) == 0
