"""Thin faces: a mesh of nothing else is measured, any other mesh stays as it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
import warp as wp

from resfit.errors import InputError
from resfit.kernels.mesh.mesh_query import MeshQuery
from resfit.kernels.mesh.slivers import seen_faces, widen_slivers
from resfit.shape.load import load_mesh
from resfit.shape.target import Target, make_target

THIN = "v 0 0 0\nv 1 0 0\nv 0 1e-6 0\nf 1 2 3\n"
NO_AREA = "v 0 0 0\nv 1 0 0\nv 0.5 1e-9 0\nf 1 2 3\n"


def turned(vertices: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Vertices (n, 3) turned in any way about the origin."""
    return vertices @ np.linalg.qr(rng.normal(size=(3, 3)))[0]


def check_finite(target: Target) -> None:
    samples = target.samples
    for values in (
        target.grid,
        samples.surface.points,
        samples.surface.weight,
        samples.near.distance,
        samples.near.weight,
        samples.volume.distance,
    ):
        assert len(values) and np.isfinite(values).all()


def test_a_thin_triangle_is_a_sheet(tmp_path: Path, device: wp.Device) -> None:
    path = tmp_path / "thin.obj"
    path.write_text(THIN)
    target = make_target(path, device, 32, 200)
    assert target.solid.kind == "shell"
    check_finite(target)


def test_a_triangle_that_rounding_leaves_nothing_of_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "line.obj"
    path.write_text(NO_AREA)
    with pytest.raises(InputError, match=r"every face of '.*line\.obj' is thinner"):
        load_mesh(path)


@pytest.mark.parametrize("width", [1e-6, 1e-5, 1e-4])
def test_distances_to_a_sliver_are_those_to_its_longest_side(
    width: float, rng: np.random.Generator, device: wp.Device
) -> None:
    for _ in range(5):
        corners = turned(np.array([[-0.9, 0, 0], [0.9, 0, 0], [rng.uniform(-0.9, 0.9), width, 0]]), rng)
        points = rng.uniform(-1.0, 1.0, (500, 3))
        asked = wp.array(points.astype(np.float32), dtype=wp.vec3, device=device)
        found = MeshQuery(corners, np.array([[0, 1, 2]]), device).closest_points(asked).distance.numpy()
        along = corners[1] - corners[0]
        share = np.clip((points - corners[0]) @ along / (along @ along), 0.0, 1.0)[:, None]
        expected = np.linalg.norm(points - corners[0] - share * along, axis=1)
        np.testing.assert_allclose(found, expected, atol=3e-3)


def test_slivers_of_every_kind_are_wide_enough_after(rng: np.random.Generator) -> None:
    corners = turned(rng.normal(size=(60, 3)) * [0.2, 0, 0], rng).reshape(20, 3, 3)
    corners += rng.uniform(-0.3, 0.3, (20, 1, 3))
    faces = np.arange(60, dtype=np.int32).reshape(-1, 3)
    vertices, same = widen_slivers(corners.reshape(-1, 3).astype(np.float32), faces)
    assert len(same) == 20 and seen_faces(vertices, same, 1e-4).all()
    moved = np.abs(vertices[same] - corners).max()
    assert moved < 5e-3


def test_slivers_among_other_faces_stay(rng: np.random.Generator) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.8)
    vertices = np.concatenate([ball.vertices, [[0.9, 0, 0], [0.9, 0.5, 0], [0.9, 0.2, 0]]]).astype(np.float32)
    sliver = [len(vertices) - 3, len(vertices) - 2, len(vertices) - 1]
    for count in (1, 1000):
        faces = np.concatenate([ball.faces, [sliver] * count]).astype(np.int32)
        kept, same = widen_slivers(vertices, faces)
        assert kept is vertices and same is faces


@pytest.mark.parametrize(
    "size",
    [(1, 2e-6, 2e-6), (1, 1e-5, 1e-3), (1, 1, 3e-6), (1e-9, 1e-9, 1e-9), (1e12, 1, 1e6)],
)
def test_needles_plates_and_specks_are_measured(
    size: tuple[float, float, float], rng: np.random.Generator, device: wp.Device
) -> None:
    """Whole boxes and open ones, turned and far from the origin."""
    box = trimesh.creation.box(size)
    for faces in (box.faces, box.faces[:-3]):
        vertices = turned(box.vertices, rng) + 10.0 * max(size)
        check_finite(make_target(trimesh.Trimesh(vertices, faces, process=False), device, 32, 200))
