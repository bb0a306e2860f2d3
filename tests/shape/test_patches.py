"""Verdicts on open patches: by the winding number beside them, and by a flood from outside."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import warp as wp

from resfit.shape.patches import (
    BOUNDARY,
    INVERTED,
    SHEET,
    Probes,
    judge_by_flood,
    judge_by_winding,
    place_probes,
    wind,
)


def ball_without(count: int) -> trimesh.Trimesh:
    """A ball of radius 0.9 of 5120 faces, less so many of the highest."""
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.9)
    mesh.update_faces(np.argsort(-mesh.triangles_center[:, 2], kind="stable")[count:])
    mesh.remove_unreferenced_vertices()
    return mesh


SQUARE = np.array([[-0.9, -0.9, 0.0], [0.9, -0.9, 0.0], [0.9, 0.9, 0.0], [-0.9, 0.9, 0.0]])
TWO = np.array([[0, 1, 2], [0, 2, 3]])


def verdict_of(judge, mesh: trimesh.Trimesh, device: wp.Device) -> int:
    patch = np.zeros(len(mesh.faces), int)
    return int(judge(mesh.vertices, np.asarray(mesh.faces), patch, patch == 0, device)[0])


@pytest.mark.parametrize("judge", [judge_by_winding, judge_by_flood])
def test_a_ball_with_a_small_hole_bounds_a_solid(judge, device: wp.Device) -> None:
    mesh = ball_without(1)
    assert verdict_of(judge, mesh, device) == BOUNDARY
    mesh.invert()
    assert verdict_of(judge, mesh, device) == INVERTED


def test_a_flood_enters_where_a_hole_is_wide(device: wp.Device) -> None:
    mesh = ball_without(60)
    assert verdict_of(judge_by_flood, mesh, device) == SHEET
    assert verdict_of(judge_by_winding, mesh, device) == BOUNDARY


@pytest.mark.parametrize("judge", [judge_by_winding, judge_by_flood])
def test_a_square_and_a_dish_enclose_nothing(judge, device: wp.Device) -> None:
    assert verdict_of(judge, trimesh.Trimesh(SQUARE, TWO), device) == SHEET
    assert verdict_of(judge, ball_without(4400), device) == SHEET


def test_only_judged_patches_are_judged(device: wp.Device) -> None:
    verdict = judge_by_winding(SQUARE, TWO, np.array([0, 1]), np.array([False, True]), device)
    assert verdict.tolist() == [BOUNDARY, SHEET]


def test_probes_lie_on_their_faces_and_fill_them_evenly() -> None:
    patch = np.array([0, 1])
    probes = place_probes(SQUARE, TWO, patch)
    assert np.bincount(probes.patch).tolist() == [48, 48]
    np.testing.assert_array_equal(probes.points[:, 2], 0.0)
    np.testing.assert_array_equal(probes.normals, np.tile([0.0, 0.0, 1.0], (96, 1)))
    assert (np.abs(probes.points) <= 0.9).all()
    # The first triangle is where x > y, its middle at (0.3, -0.3).
    first = probes.points[probes.patch == 0]
    assert (first[:, 0] >= first[:, 1] - 1e-12).all()
    np.testing.assert_allclose(first.mean(axis=0), [0.3, -0.3, 0.0], atol=0.08)


def test_share_of_a_patch_without_probes_is_zero() -> None:
    probes = Probes(np.zeros((3, 3)), np.zeros((3, 3)), np.array([0, 0, 2]))
    assert probes.share(np.array([True, False, True]), 4).tolist() == [0.5, 0.0, 1.0, 0.0]


def test_winding_number_of_a_box(device: wp.Device) -> None:
    mesh = trimesh.creation.box()
    points = np.array([[0.1, 0.2, 0.3], [2.0, 0.0, 0.0]])
    np.testing.assert_allclose(wind(mesh.vertices, mesh.faces, points, device), [1.0, 0.0], atol=1e-5)
    turned = wind(mesh.vertices, mesh.faces[:, ::-1], points, device)
    np.testing.assert_allclose(turned, [-1.0, 0.0], atol=1e-5)
