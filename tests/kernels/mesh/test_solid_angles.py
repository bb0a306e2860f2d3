"""Winding numbers of crowded meshes: the sum over all faces is that of the hierarchy, and taken where it is faster."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import warp as wp

from resfit.kernels.field.points import point_blocks
from resfit.kernels.mesh.inside_points import winding_numbers
from resfit.kernels.mesh.mesh_query import MeshQuery
from resfit.kernels.mesh.solid_angles import summed_winding_numbers
from resfit.kernels.runtime.launch import profiled
from resfit.shape.solid_query import WindingQuery


def soup(count: int, rng: np.random.Generator, device: wp.Device) -> MeshQuery:
    corners = rng.uniform(-0.9, 0.9, (3 * count, 3))
    return MeshQuery(corners, np.arange(3 * count).reshape(-1, 3), device)


def summed(query: MeshQuery, points: np.ndarray) -> np.ndarray:
    return summed_winding_numbers(query, point_blocks(points, query.device)).numpy()


def test_nested_boxes_wind_once_and_twice(rng: np.random.Generator, device: wp.Device) -> None:
    box = trimesh.creation.box((1.6, 1.6, 1.6))
    query = MeshQuery(
        np.concatenate([box.vertices, 0.5 * box.vertices]), np.concatenate([box.faces, box.faces + 8]), device
    )
    points = rng.uniform(-1.0, 1.0, (333, 3))
    depth = np.abs(points).max(axis=1)
    clear = (np.abs(depth - 0.8) > 1e-3) & (np.abs(depth - 0.4) > 1e-3)
    expected = (depth < 0.8).astype(int) + (depth < 0.4)
    np.testing.assert_allclose(summed(query, points)[clear], expected[clear], atol=1e-5)


def test_points_on_corners_have_a_winding_number(rng: np.random.Generator, device: wp.Device) -> None:
    query = soup(20, rng, device)
    assert np.isfinite(summed(query, query.vertices.numpy())).all()


def test_a_crowd_is_added_up_to_the_same(rng: np.random.Generator, device: wp.Device) -> None:
    query = soup(1500, rng, device)
    points = rng.uniform(-1.0, 1.0, (900, 3)).astype(np.float32)
    asked = wp.array(points, dtype=wp.vec3, device=device)
    with profiled() as usage:
        found = winding_numbers(query, asked).numpy()
    assert set(usage) == {"add_solid_angles_kernel"}
    few = wp.array(points[:90], dtype=wp.vec3, device=device)
    np.testing.assert_allclose(found[:90], winding_numbers(query, few).numpy(), atol=0.02)


def test_an_ordinary_mesh_keeps_its_hierarchy(rng: np.random.Generator, device: wp.Device) -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.9)
    query = MeshQuery(ball.vertices, ball.faces, device)
    asked = wp.array(rng.uniform(-1.0, 1.0, (900, 3)).astype(np.float32), dtype=wp.vec3, device=device)
    with profiled() as usage:
        winding_numbers(query, asked)
    assert set(usage) == {"measure_winding_kernel"}


@pytest.mark.parametrize(("count", "size", "looks"), [(600, 1.0, False), (20, 0.1, True)])
def test_no_rays_are_cast_through_a_crowd(
    count: int, size: float, looks: bool, rng: np.random.Generator, device: wp.Device
) -> None:
    box = trimesh.creation.box((size,) * 3)
    centres = rng.uniform(-0.9 + size / 2, 0.9 - size / 2, (count, 1, 3))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    vertices = 0.6 * (box.vertices + centres).reshape(-1, 3) @ turn.T
    faces = (box.faces + 8 * np.arange(count)[:, None, None]).reshape(-1, 3)
    query = WindingQuery(vertices, faces, device)
    points = rng.uniform(-1.0, 1.0, (500, 3))
    with profiled() as usage:
        found = query.contains(0.6 * points @ turn.T)
    assert ("look_at_cells_kernel" in usage) == looks
    depth = np.abs(points[:, None] - centres[:, 0]).max(axis=2)
    clear = np.abs(depth - size / 2).min(axis=1) > 1e-4
    np.testing.assert_array_equal(found[clear], (depth < size / 2).any(axis=1)[clear])
