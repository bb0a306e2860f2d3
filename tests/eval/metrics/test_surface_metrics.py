"""Distances between surfaces, IoU near them, and features of parts, against answers computed another way."""

from __future__ import annotations

import sys
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
import trimesh

from resfit.errors import InputError
from resfit.eval.metrics.features import make_features
from resfit.eval.metrics.semantic_metrics import measure_semantics
from resfit.eval.metrics.surface_metrics import (
    bisurf_iou,
    chamfer,
    draw_faces,
    draw_surface,
    earth_movers,
    sort_points,
    surface_distance,
)


def ball(radius: float):
    return lambda points: np.linalg.norm(points, axis=1) < radius


def on_sphere(radius: float, count: int, rng: np.random.Generator) -> np.ndarray:
    way = rng.normal(size=(count, 3))
    return radius * way / np.linalg.norm(way, axis=1, keepdims=True)


def test_chamfer_is_a_hundred_mean_squares() -> None:
    a, b = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 0.5]])
    # There: 0.25 and 1.25; back: 0.25.
    assert chamfer(a, b) == pytest.approx(100 * 0.5 * (0.75 + 0.25))
    assert chamfer(a, a) == 0.0


def test_earth_movers_distance_is_the_best_assignment(rng: np.random.Generator) -> None:
    a, b = rng.normal(size=(2, 6, 3))
    best = min(np.linalg.norm(a - b[list(order)], axis=1).mean() for order in permutations(range(6)))
    assert earth_movers(a, b) == pytest.approx(best)
    shift = np.array([0.3, 0.0, 0.4])
    assert earth_movers(a, rng.permutation(a + shift)) == pytest.approx(0.5)


def test_points_are_drawn_by_area(rng: np.random.Generator) -> None:
    mesh = trimesh.creation.box((1.0, 1.0, 3.0))
    points, face = draw_faces(np.asarray(mesh.vertices), np.asarray(mesh.faces), 20_000, rng)
    assert np.abs(np.abs(points) / (0.5, 0.5, 1.5)).max(axis=1) == pytest.approx(1.0, abs=1e-6)
    ends = np.abs(points[:, 2]) > 1.4999
    assert ends.mean() == pytest.approx(2 / 14, abs=0.01)
    assert np.abs(mesh.face_normals[face[ends]][:, 2]).mean() > 0.99
    assert np.abs(points.mean(axis=0)) == pytest.approx(0.0, abs=0.02)


def test_sorted_points_are_the_same_points(rng: np.random.Generator) -> None:
    points = rng.uniform(-1.5, 1.5, (1000, 3)).astype(np.float32)
    ordered = sort_points(points)
    np.testing.assert_array_equal(np.sort(ordered, axis=0), np.sort(points, axis=0))
    steps, before = (np.linalg.norm(np.diff(some, axis=0), axis=1).mean() for some in (ordered, points))
    assert steps < 0.5 * before


def test_bisurf_iou_of_two_balls(rng: np.random.Generator) -> None:
    r, s, sigma = 0.6, 0.63, 0.02
    found = bisurf_iou(
        on_sphere(r, 40_000, rng),
        on_sphere(s, 40_000, rng),
        sigma,
        ball(r),
        ball(s),
        np.random.default_rng(1),
    )
    # The small ball is inside the large one: of the points inside the large one, the share inside the small one.
    shares = []
    for radius in (r, s):
        # Far from its middle a ball is a half space: what counts is the noise along the normal.
        distance = np.linalg.norm(
            on_sphere(radius, 200_000, rng) + rng.normal(scale=sigma, size=(200_000, 3)), axis=1
        )
        shares.append((distance < r).sum() / (distance < s).sum())
    assert found == pytest.approx(np.mean(shares), abs=0.01)
    from math import erf, sqrt

    def below(x: float) -> float:
        return 0.5 * (1 + erf(x / sqrt(2)))

    flat = 0.5 * (below(0) / below(1.5) + below(-1.5) / below(0))
    assert found == pytest.approx(flat, abs=0.02)


def test_prediction_without_surface_has_half_of_nothing(rng: np.random.Generator) -> None:
    points = on_sphere(0.5, 100, rng)

    def nothing(asked: np.ndarray) -> np.ndarray:
        return np.zeros(len(asked), bool)

    assert bisurf_iou(points, points[:0], 0.02, ball(0.5), nothing, rng) == 0.0


def test_surface_distance_takes_both_ways_together() -> None:
    found = surface_distance(np.array([-1.0, 1.0]), np.array([3.0, 3.0]))
    assert (found.mean, found.largest) == (2.0, 3.0)


def test_draws_depend_on_their_source_alone() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=1)
    a, b = (
        draw_surface(np.asarray(mesh.vertices), np.asarray(mesh.faces), 50, np.random.default_rng(3))
        for _ in "ab"
    )
    np.testing.assert_array_equal(a, b)


def test_features_that_agree_with_the_parts() -> None:
    # Two parts, features at a right angle, and of any length.
    features = np.array([[2.0, 0.0], [0.5, 0.0], [0.0, 3.0], [0.0, 1.0]])
    found = measure_semantics(features, np.array([4, 4, 7, 7]))
    assert found.intra_prim == pytest.approx(0.0, abs=1e-12)
    assert found.inter_prim == pytest.approx(np.sqrt(2.0))


def test_features_that_do_not() -> None:
    features = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    found = measure_semantics(features, np.array([0, 0, 1, 1, 1]))
    # Means (1/2, 1/2) and (1/3, 2/3): mean squares 1/2 and 4/9 over two and three points.
    assert found.intra_prim == pytest.approx((2 * 0.5 + 3 * 4 / 9) / 5)
    assert found.inter_prim == pytest.approx(np.hypot(1 / 6, 1 / 6))


def test_inter_prim_is_weighted_by_points_and_asks_the_nearest() -> None:
    angle = np.array([0.0, 0.0, 0.0, 0.2, 1.0])
    found = measure_semantics(np.stack([np.cos(angle), np.sin(angle)], axis=1), np.array([0, 0, 0, 1, 2]))
    near, far = 2 * np.sin(0.1), 2 * np.sin(0.4)
    assert found.inter_prim == pytest.approx((4 * near + far) / 5)


def test_one_part_has_no_neighbour() -> None:
    assert measure_semantics(np.eye(3), np.zeros(3, int)).inter_prim == 0.0


@pytest.mark.parametrize(
    "features",
    [np.zeros((2, 3)), np.zeros(3), np.full((3, 2), np.nan), [["a"], ["b"], ["c"]], np.zeros((3, 0))],
)
def test_features_of_the_wrong_kind(features) -> None:
    with pytest.raises(InputError):
        measure_semantics(features, np.zeros(3, int))


POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]])


def test_features_from_a_command(tmp_path: Path) -> None:
    script = tmp_path / "its features.py"
    script.write_text(
        "import sys, numpy as np\n"
        "mesh, points, out = sys.argv[1:]\n"
        "assert open(mesh, 'rb').read(4) == b'glTF'\n"
        "np.save(out, np.load(points)[:, :2] + 1)\n"
    )
    command = f"{sys.executable} '{script}' {{mesh}} {{points}} {{out}}"
    points, features = make_features(command, trimesh.creation.box(), POINTS)
    np.testing.assert_array_equal(points, POINTS)
    np.testing.assert_array_equal(features, POINTS[:, :2] + 1)


def test_features_at_points_of_their_own(tmp_path: Path) -> None:
    own = np.ones((5, 3)), np.eye(5)
    for source in (own, lambda mesh, points: own):
        points, features = make_features(source, trimesh.creation.box(), POINTS)
        assert len(points) == len(features) == 5
    np.savez(tmp_path / "own.npz", points=own[0], features=own[1])
    assert make_features(str(tmp_path / "own.npz"), "mesh.glb", POINTS)[1].shape == (5, 5)


def broken(mesh: Path, points: np.ndarray) -> np.ndarray:
    raise RuntimeError("no weights")


@pytest.mark.parametrize(
    ("source", "sentence"),
    [
        ("no-such-source", "neither a command"),
        ("false {mesh} {points} {out}", "exit code 1"),
        ("true {mesh} {points} {out}", "no features in"),
        ("no-such-program {out}", "did not run"),
        ("'unbalanced {out}", "cannot be understood"),
        ("missing.npz", "no features in"),
        (broken, "no weights"),
        (lambda mesh, points: np.zeros((7, 2)), "give \\(n, d\\)"),
        (3, "cannot come from"),
    ],
)
def test_features_that_cannot_be_had(source, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        make_features(source, trimesh.creation.box(), POINTS)
