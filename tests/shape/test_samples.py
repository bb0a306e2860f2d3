"""Samples, curvature, thickness and the target as a whole, on shapes whose answers are known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import warp as wp
from trimesh import creation

from resfit.errors import InputError
from resfit.shape.curvature import MAX_CURVATURE, measure_curvature
from resfit.shape.samples import NOISE
from resfit.shape.target import Target, make_target


def target_of(mesh: trimesh.Trimesh, device: wp.Device, **options) -> Target:
    return make_target(mesh, device, **({"resolution": 32, "sample_count": 2000} | options))


def plate_with_pin() -> trimesh.Trimesh:
    """A large plate, and far from it a pin with a ten-thousandth of its area."""
    pin = creation.box(extents=(0.004, 0.004, 0.05))
    pin.apply_translation((0.0, 0.0, 0.4))
    return trimesh.util.concatenate([creation.box(extents=(1.8, 1.8, 0.1)), pin])


def test_curvature_of_a_ball_and_a_rod() -> None:
    ball = creation.icosphere(subdivisions=4, radius=0.25)
    bend = measure_curvature(ball.vertices, ball.faces)
    assert bend.creases is None
    np.testing.assert_allclose(bend.face, 4.0, rtol=0.06)
    rod = creation.cylinder(radius=0.1, height=1.0, sections=48)
    bend = measure_curvature(rod.vertices, rod.faces)
    round_faces = np.abs(rod.face_normals[:, 2]) < 0.5
    np.testing.assert_allclose(bend.face[round_faces], 10.0, rtol=0.06)
    np.testing.assert_allclose(bend.face[~round_faces], 0.0, atol=1e-4)


def test_creases_count_as_the_largest_curvature() -> None:
    box = creation.box(extents=(1.8, 1.8, 1.8))
    bend = measure_curvature(box.vertices, box.faces)
    np.testing.assert_allclose(bend.face, 0.0, atol=1e-4)
    face = int(np.argmax(box.face_normals[:, 2]))
    points = np.array([[0.1, 0.2, 0.9], [0.89, 0.2, 0.9]])
    np.testing.assert_allclose(bend.at(points, np.array([face, face])), [0.0, MAX_CURVATURE], atol=1e-4)


def test_samples_are_where_they_say(device: wp.Device) -> None:
    target = target_of(creation.icosphere(subdivisions=4, radius=3.0), device)
    samples, radius = target.samples, 0.9
    surface = samples.surface
    np.testing.assert_allclose(np.linalg.norm(surface.points, axis=1), radius, atol=4e-3)
    np.testing.assert_allclose(np.linalg.norm(surface.normals, axis=1), 1.0, atol=1e-5)
    assert (np.einsum("ij,ij->i", surface.points, surface.normals) > 0.88).all()
    for points, distance in (
        (samples.near.points, samples.near.distance),
        (samples.volume.points, samples.volume.distance),
    ):
        np.testing.assert_allclose(distance, np.linalg.norm(points, axis=1) - radius, atol=4e-3)
    assert samples.near.distance.std() == pytest.approx(NOISE * 0.88, rel=0.1)
    # The curvature of this ball is 1 / 0.9.
    np.testing.assert_allclose(samples.near.weight, 1.0 + 1.0 / (1.0 + np.exp(-1.11)), atol=0.02)
    share = (samples.volume.distance < 0.0).mean()
    assert share == pytest.approx(np.pi / 6.0, abs=0.01)
    assert target.volume == pytest.approx(4.0 / 3.0 * np.pi * radius**3, rel=0.02)


def test_surface_points_are_spread_by_area(device: wp.Device) -> None:
    target = target_of(creation.box(extents=(2.0, 1.0, 0.5)), device)
    axis = np.abs(target.samples.surface.normals).argmax(axis=1)
    np.testing.assert_allclose(np.bincount(axis) / len(axis), np.array([0.5, 1.0, 2.0]) / 3.5, atol=0.002)


def test_nothing_thin_is_forgotten(device: wp.Device) -> None:
    target = target_of(plate_with_pin(), device, resolution=64)
    on_pin = target.samples.surface.points[:, 2] > 0.1
    assert on_pin.sum() >= 10
    # The pin is a thirtieth of a cell wide: its inside exists for samples and queries alone.
    middle = np.array([[0.0, 0.0, 0.4 - (0.425 - target.upper[2])]])
    assert target.query.signed_distance(middle)[0] == pytest.approx(-0.002, abs=1e-4)


def test_seed_decides_everything(device: wp.Device) -> None:
    mesh = creation.annulus(0.3, 0.6, 0.5)
    first, again, other = (target_of(mesh, device, seed=seed) for seed in (0, 0, 1))
    for kind in ("surface", "near", "volume"):
        points = [getattr(target.samples, kind).points for target in (first, again, other)]
        np.testing.assert_array_equal(points[0], points[1])
        assert not np.array_equal(points[0], points[2])
    np.testing.assert_array_equal(first.samples.near.distance, again.samples.near.distance)
    np.testing.assert_array_equal(first.grid, again.grid)


@pytest.mark.parametrize(("scale", "offset"), [(1e-7, 0.0), (1.0, 1e6), (1e5, -3e5)])
def test_scale_and_offset_change_nothing(device: wp.Device, scale: float, offset: float) -> None:
    mesh = creation.capsule(height=1.0, radius=0.3, count=[12, 12])
    moved = mesh.copy()
    moved.vertices = moved.vertices * scale + offset
    first, second = target_of(mesh, device), target_of(moved, device)
    np.testing.assert_array_equal(first.faces, second.faces)
    np.testing.assert_allclose(first.vertices, second.vertices, atol=1e-6)
    np.testing.assert_allclose(first.grid, second.grid, atol=1e-5)
    assert second.transform.scale == pytest.approx(first.transform.scale * scale, rel=1e-6)


def test_stages_and_sheets(device: wp.Device) -> None:
    stages: list[str] = []
    sheet = trimesh.Trimesh([[0, 0, 0], [2, 0, 0], [2, 2, 0]], [[0, 1, 2]], process=False)
    target = target_of(sheet, device, on_stage=stages.append)
    assert stages == ["load", "solid", "grid", "samples"]
    assert target.sentence == target.solid.sentence
    assert len(target.samples.near.points) == len(target.samples.volume.points) == 2000
    depth = target.query.signed_distance(target.samples.surface.points)
    np.testing.assert_allclose(depth, 0.0, atol=1e-3)
    assert (target.samples.volume.distance < 0.0).any()


def test_bad_input_reaches_the_caller(device: wp.Device) -> None:
    with pytest.raises(InputError):
        make_target("no such file.stl", device)
