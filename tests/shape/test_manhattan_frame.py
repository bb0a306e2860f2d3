"""The axes along which most of a mesh looks: found however it is turned, and not made up where there are none."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from resfit.shape.manhattan_frame import manhattan_frame


def bracket() -> trimesh.Trimesh:
    """Two plates at a right angle, and a round boss."""
    plates = [trimesh.creation.box((1.6, 1.0, 0.2)), trimesh.creation.box((0.2, 1.0, 1.0))]
    plates[1].apply_translation((-0.7, 0.0, 0.5))
    boss = trimesh.creation.cylinder(0.2, 0.4, sections=32)
    boss.apply_translation((0.3, 0.0, 0.2))
    return trimesh.util.concatenate([*plates, boss])


@pytest.mark.parametrize("seed", range(5))
def test_a_turned_mesh_is_stood_straight(seed: int) -> None:
    turn = Rotation.random(random_state=seed).as_matrix()
    found = manhattan_frame(bracket().vertices @ turn.T, bracket().faces)
    assert found is not None
    assert np.linalg.det(found) == pytest.approx(1.0)
    # Its own axes are the grid's again, though maybe others.
    np.testing.assert_allclose(np.sort(np.abs(found @ turn).ravel()), [0.0] * 6 + [1.0] * 3, atol=1e-6)


def test_the_smallest_turn_is_taken() -> None:
    turn = Rotation.from_euler("xyz", (20, -15, 30), degrees=True).as_matrix()
    found = manhattan_frame(bracket().vertices @ turn.T, bracket().faces)
    np.testing.assert_allclose(found, turn.T, atol=1e-6)


def test_what_stands_straight_or_has_no_axes_stays() -> None:
    assert manhattan_frame(bracket().vertices, bracket().faces) is None
    ball = trimesh.creation.icosphere(subdivisions=3)
    assert manhattan_frame(ball.vertices, ball.faces) is None
    assert manhattan_frame(np.zeros((3, 3)), np.array([[0, 1, 2]])) is None


def test_a_slanted_rod_has_its_length_and_what_turns_least() -> None:
    """Of a round rod the faces look across its axis only."""
    rod = trimesh.creation.cylinder(0.1, 1.6, sections=48)
    turn = Rotation.from_euler("y", 35, degrees=True).as_matrix()
    found = manhattan_frame(rod.vertices @ turn.T, rod.faces)
    assert found is not None
    np.testing.assert_allclose(found @ turn[:, 2], [0.0, 0.0, 1.0], atol=1e-6)
