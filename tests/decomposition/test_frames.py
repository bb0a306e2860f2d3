"""How regions lie: axes, extents, holes, tapers and arcs of point clouds whose shape is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from resfit.decomposition.oriented_boxes import (
    find_arcs,
    missing_margin,
    place,
    principal_axes,
    robust_bounds,
)

STEP = 0.02
LINE = np.arange(-0.6 + 0.5 * STEP, 0.6, STEP)
X, Y, Z = np.stack(np.meshgrid(LINE, LINE, LINE, indexing="ij")).reshape(3, -1)
HALF_CELL = np.array([0.5 * STEP])


def cloud(inside: np.ndarray) -> np.ndarray:
    """Cell centres (1, m, 3) of one region."""
    return np.stack([X, Y, Z], axis=1)[inside][None]


def principal(points: np.ndarray) -> np.ndarray:
    return principal_axes(points, np.cov(points[0].T)[None])[0]


def box(turn: np.ndarray) -> np.ndarray:
    """Points of a box, 1 x 0.6 x 0.2, turned."""
    return cloud((abs(X) < 0.5) & (abs(Y) < 0.3) & (abs(Z) < 0.1)) @ turn.T


@pytest.mark.parametrize("seed", range(4))
def test_principal_axes_of_a_box_are_its_own(seed: int) -> None:
    turn = Rotation.random(random_state=seed).as_matrix()
    axes = principal(box(turn))
    np.testing.assert_allclose(np.abs(axes.T @ turn), np.eye(3), atol=1e-6)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_a_square_rod_is_turned_to_its_faces() -> None:
    """Its two smaller spreads are equal: the smallest rectangle decides, of those tried at every 6 degrees."""
    rod = cloud((abs(X) < 0.12) & (abs(Y) < 0.12) & (abs(Z) < 0.5))
    turn = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    axes = principal(rod @ turn.T)
    np.testing.assert_allclose(np.abs(axes.T @ turn).max(axis=1), 1.0, atol=1.0 - np.cos(np.radians(3.0)))
    assert abs(axes[2, 0]) == pytest.approx(1.0)


def test_bounds_leave_out_stray_points() -> None:
    values = np.concatenate([np.linspace(-1.0, 1.0, 1000), [50.0]])[None, :, None]
    low, high = robust_bounds(values, np.array([[0.25]]))
    assert low[0, 0] == pytest.approx(-1.25, abs=0.02) and high[0, 0] == pytest.approx(1.25, abs=0.02)


def test_slanted_extents_lack_less_than_half_a_cell() -> None:
    slanted = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    np.testing.assert_allclose(missing_margin(slanted[None], np.array([0.1])), [[0.02, 0.02, 0.1]])


def test_box_of_a_region_for_each_sweep() -> None:
    found = place(box(np.eye(3)), np.eye(3)[None], HALF_CELL)
    np.testing.assert_allclose(
        found.extent[0], [[0.6, 0.2, 1.0], [0.2, 1.0, 0.6], [1.0, 0.6, 0.2]], atol=0.03
    )
    np.testing.assert_allclose(found.centre[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(found.axes[0]), 1.0)
    np.testing.assert_array_equal(found.axes[0, :, :, 2], np.eye(3))
    np.testing.assert_array_less(found.hole, 0.1)
    np.testing.assert_allclose(found.taper, 1.0, atol=1e-9)


def test_hole_of_a_tube_is_seen_along_its_axis_only() -> None:
    r = np.hypot(X, Y)
    found = place(cloud((r < 0.5) & (r > 0.3) & (abs(Z) < 0.4)), np.eye(3)[None], HALF_CELL)
    along = found.axes[0, :, 2, 2] == 1.0
    assert found.hole[0, along][0] == pytest.approx(0.6, abs=0.04)
    np.testing.assert_array_less(found.hole[0, ~along], 0.1)


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_taper_of_a_pyramid(up: float) -> None:
    """Twice as wide at one end as at the other."""
    width = 0.3 - 0.25 * up * Z
    found = place(cloud((abs(X) < width) & (abs(Y) < width) & (abs(Z) < 0.4)), np.eye(3)[None], HALF_CELL)
    along = found.axes[0, :, 2, 2] == 1.0
    assert found.taper[0, along][0] == pytest.approx(0.5**up, rel=0.1)


@pytest.mark.parametrize("turned", [0.0, 130.0])
def test_arc_of_a_half_ring(turned: float) -> None:
    ring = cloud((abs(np.hypot(X, Y) - 0.4) < 0.08) & (abs(Z) < 0.06) & (X < 0.0))
    turn = Rotation.from_euler("z", turned, degrees=True).as_matrix()
    found = find_arcs(ring @ turn.T, np.eye(3)[None], HALF_CELL)
    seen = int(np.argmax(np.abs(found.axes[0, :, 2, 1])))
    assert found.radius[0, seen] == pytest.approx(0.4, abs=0.02)
    assert found.half_angle[0, seen] == pytest.approx(0.5 * np.pi, abs=0.06)
    assert found.width[0, seen] == pytest.approx(0.16, abs=0.03)
    assert found.height[0, seen] == pytest.approx(0.12, abs=0.03)
    np.testing.assert_allclose(found.centre[0, seen], 0.0, atol=0.04)
    # The local -x points from the centre to the middle of the arc.
    np.testing.assert_allclose(found.axes[0, seen, :, 0], turn @ [1.0, 0.0, 0.0], atol=0.05)


def test_a_whole_ring_has_no_end() -> None:
    ring = cloud((abs(np.hypot(X, Y) - 0.4) < 0.08) & (abs(Z) < 0.06))
    found = find_arcs(ring, np.eye(3)[None], HALF_CELL)
    seen = int(np.argmax(np.abs(found.axes[0, :, 2, 1])))
    assert found.half_angle[0, seen] == np.pi and found.radius[0, seen] == pytest.approx(0.4, abs=0.02)
