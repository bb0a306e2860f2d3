"""Distances near crowded meshes: the same as by queries, of each cell, and only where queries would be slow."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import warp as wp

from resfit.kernels.mesh import mesh_grid, mesh_rows
from resfit.kernels.mesh.mesh_grid import BAND, unsigned_distance_grid
from resfit.kernels.mesh.mesh_query import MeshQuery
from resfit.kernels.mesh.mesh_rows import is_crowded, measure_band
from resfit.kernels.runtime import launch as launching

RESOLUTION = 24


def soup(count: int, rng: np.random.Generator, device: wp.Device) -> MeshQuery:
    """Random triangles, a sliver and a point among them, which queries do not see."""
    corners = rng.uniform(-0.9, 0.9, (count, 3, 3))
    corners[1, 2] = corners[1, 0] + 1e-7
    corners[2] = corners[2, :1]
    return MeshQuery(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), device)


def test_cells_near_a_soup_are_measured_as_by_queries(rng: np.random.Generator, device: wp.Device) -> None:
    query, reach = soup(300, rng, device), BAND * 2.0 / RESOLUTION
    band = measure_band(query, RESOLUTION, reach)
    middles = (2.0 * np.indices((RESOLUTION,) * 3).reshape(3, -1).T + 1.0) / RESOLUTION - 1.0
    asked = wp.array(middles.astype(np.float32), dtype=wp.vec3, device=device)
    expected = query.closest_points(asked).distance.numpy()
    near = band.near.numpy().ravel()
    clear = np.abs(expected - reach) > 1e-5
    np.testing.assert_array_equal(near[clear], expected[clear] < reach)
    np.testing.assert_allclose(band.distance.numpy().ravel()[near], expected[near], atol=1e-6)
    found = band.found.numpy().ravel()
    np.testing.assert_array_equal(found >= 0, near)
    away = np.linalg.norm(band.point.numpy()[found[near]] - middles[near], axis=1)
    np.testing.assert_allclose(away, expected[near], atol=1e-6)


def test_the_grid_of_a_sphere_is_the_same_either_way(
    device: wp.Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.8)
    query = MeshQuery(ball.vertices, ball.faces, device)
    expected = unsigned_distance_grid(query, RESOLUTION).numpy()
    monkeypatch.setattr(mesh_grid, "is_crowded", lambda vertices, faces: True)
    np.testing.assert_allclose(unsigned_distance_grid(query, RESOLUTION).numpy(), expected, atol=1e-6)


def crowded(query: MeshQuery) -> bool:
    return is_crowded(query.vertices.numpy(), query.faces.numpy().reshape(-1, 3))


def test_only_thousands_of_faces_across_each_other_are_crowded(
    rng: np.random.Generator, device: wp.Device
) -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.9)
    assert not is_crowded(ball.vertices, ball.faces)
    assert not crowded(soup(100, rng, device))
    assert crowded(soup(2000, rng, device))


def test_a_crowd_is_seen_in_some_of_its_faces(
    rng: np.random.Generator, device: wp.Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mesh_rows, "LOOKED_AT", 50)
    assert crowded(soup(2000, rng, device))


def test_the_same_bytes_on_one_core_and_two(
    rng: np.random.Generator, device: wp.Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    query, results = soup(300, rng, device), []
    for cores in (1, 2):
        monkeypatch.setattr(launching, "core_count", lambda cores=cores: cores)
        results.append(measure_band(query, RESOLUTION, 0.1).distance.numpy().tobytes())
    assert results[0] == results[1]


def test_a_mesh_beyond_the_grid_is_refused(rng: np.random.Generator, device: wp.Device) -> None:
    far = MeshQuery(rng.uniform(5.0, 6.0, (9, 3)), np.arange(9).reshape(-1, 3), device)
    with pytest.raises(ValueError, match="inside the grid"):
        measure_band(far, RESOLUTION, 0.1)
