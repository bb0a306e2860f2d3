"""Between mesh units and the normalised frame: exact far from the origin, refusing what has no extent."""

from __future__ import annotations

import math

import numpy as np
import pytest

from resfit.assembly.transform import NORMALISED_SIDE, Transform, as_points
from resfit.errors import AssemblyError, InputError


def test_from_bounds_centres_and_scales() -> None:
    transform = Transform.from_bounds([1.0, 2.0, 3.0], [3.0, 6.0, 4.0])
    corners = transform.to_normalised([[1.0, 2.0, 3.0], [3.0, 6.0, 4.0]])
    np.testing.assert_allclose(corners[0], -corners[1], atol=1e-15)
    assert np.ptp(corners, axis=0).max() == pytest.approx(NORMALISED_SIDE)


def test_round_trip_a_million_units_away(rng: np.random.Generator) -> None:
    offset = np.array([1e6, -2e6, 3e6])
    points = offset + rng.uniform(-0.5, 0.5, (1000, 3))
    transform = Transform.from_bounds(points.min(axis=0), points.max(axis=0))
    normalised = transform.to_normalised(points).astype(np.float32)
    # What float32 loses in the normalised frame, not what it would lose at 3e6 (0.25).
    np.testing.assert_allclose(transform.to_mesh(normalised), points, atol=2e-7)


def test_huge_and_tiny_boxes() -> None:
    for size in (1e-300, 1e-30, 1e30, 1e308):
        transform = Transform.from_bounds([-size, 0, 0], [size, 0, 0])
        np.testing.assert_allclose(transform.to_normalised([[size, 0, 0]]), [[0.9, 0, 0]])


@pytest.mark.parametrize(
    ("lower", "upper"),
    [([0, 0, 0], [0, 0, 0]), ([0, 0, 0], [math.nan, 1, 1]), ([0, 0, 0], [math.inf, 1, 1]), ([1, 1], [2, 2])],
)
def test_boxes_without_extent_are_refused(lower: list[float], upper: list[float]) -> None:
    with pytest.raises(InputError):
        Transform.from_bounds(lower, upper)


@pytest.mark.parametrize("scale", [0.0, -1.0, math.nan, math.inf])
def test_scales_that_are_none(scale: float) -> None:
    with pytest.raises(AssemblyError, match=r"transform\.scale"):
        Transform(scale)


def test_translation_must_be_finite() -> None:
    with pytest.raises(AssemblyError, match=r"transform\.translation"):
        Transform(1.0, (0.0, math.nan, 0.0))


def test_points_of_every_shape() -> None:
    assert as_points([]).shape == (0, 3)
    assert as_points(np.zeros((0, 3))).shape == (0, 3)
    assert as_points([[1, 2, 3]]).dtype == np.float64
    for wrong in ([1, 2, 3], [[1, 2]], "text", [["a", "b", "c"]], np.zeros((2, 3, 3)), [[1, 2, 3], [4]]):
        with pytest.raises(InputError):
            as_points(wrong)  # type: ignore[arg-type]


def test_distances_in_mesh_units_do_not_warn() -> None:
    assert Transform(2.0).to_mesh_distance(np.array([0.5, -1.0])).tolist() == [1.0, -2.0]
    assert np.isinf(Transform(1e300).to_mesh_distance(np.array([1.0]))).all()
