"""Mesh queries against analytic answers, and the signed distance grid against dense queries."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import warp as wp
from trimesh import creation

from resfit.kernels.mesh.mesh_grid import BAND, signed_distance_grid
from resfit.kernels.mesh.mesh_query import MeshQuery

RESOLUTION = 32


def box(size: float, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> trimesh.Trimesh:
    mesh = creation.box(extents=(size, size, size))
    mesh.apply_translation(centre)
    return mesh


def inverted(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh = mesh.copy()
    mesh.invert()
    return mesh


def make(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of the test mesh called `name`, inside [-0.9, 0.9]^3."""
    turn = trimesh.transformations.rotation_matrix(0.7, (0.3, 1.0, 0.5))
    if name == "box":
        mesh = box(1.8)
    elif name == "box on sample planes":
        # Half a cell off the cell borders: faces, edges and corners all fall on cell centres.
        mesh = box(16 * 2 / RESOLUTION, (1 / RESOLUTION,) * 3)
    elif name == "tilted box":
        mesh = box(0.9).apply_transform(turn)
    elif name == "sphere":
        mesh = creation.icosphere(subdivisions=4, radius=0.9)
    elif name == "torus":
        mesh = creation.torus(0.65, 0.25, 48, 24).apply_transform(turn)
    elif name == "overlapping boxes":
        mesh = trimesh.util.concatenate([box(1.0, (-0.3, -0.2, 0.0)), box(0.9, (0.31, 0.2, 0.1))])
    elif name == "cavity":
        mesh = trimesh.util.concatenate([box(1.6), inverted(box(0.77, (0.1, 0.0, 0.0)))])
    elif name == "thin plate":
        mesh = creation.box(extents=(1.8, 0.02, 1.1)).apply_transform(turn)
        mesh.apply_scale(0.8)
    elif name == "inverted":
        mesh = inverted(creation.icosphere(subdivisions=3, radius=0.8))
    elif name == "open box":
        mesh = box(1.4)
        mesh.update_faces(mesh.face_normals[:, 2] < 0.9)
    elif name == "open hemisphere":
        mesh = creation.icosphere(subdivisions=3, radius=0.9)
        mesh.update_faces(mesh.triangles_center[:, 1] < 0.0)
    elif name == "duplicate faces":
        mesh = trimesh.util.concatenate([box(1.2), box(1.2)])
    elif name == "some faces turned":
        mesh = creation.icosphere(subdivisions=2, radius=0.8)
        mesh.faces[::9] = mesh.faces[::9, ::-1]
    elif name == "soup":
        rng = np.random.default_rng(5)
        corners = rng.uniform(-0.7, 0.7, (12, 1, 3)) + rng.uniform(-0.2, 0.2, (12, 3, 3))
        return corners.reshape(-1, 3), np.arange(36).reshape(-1, 3)
    else:
        raise KeyError(name)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


CLOSED = ["box", "box on sample planes", "tilted box", "sphere", "torus", "overlapping boxes", "cavity",
          "thin plate", "inverted", "duplicate faces"]  # fmt: skip
OPEN = ["open box", "open hemisphere", "some faces turned", "soup"]


def query(name: str, device: wp.Device) -> MeshQuery:
    return MeshQuery(*make(name), device)


def centres(resolution: int) -> np.ndarray:
    """Cell centres (n^3, 3) of the grid, x slowest."""
    cells = np.stack(np.indices((resolution,) * 3), axis=-1).reshape(-1, 3)
    return (2 * cells + 1) / resolution - 1


def points_on(device: wp.Device, points: np.ndarray) -> wp.array:
    return wp.array(points.astype(np.float32), dtype=wp.vec3, device=device)


@pytest.mark.parametrize("name", CLOSED + OPEN)
@pytest.mark.parametrize("resolution", [RESOLUTION, 27])
def test_grid_equals_dense_queries(name: str, resolution: int, device: wp.Device) -> None:
    mesh = query(name, device)
    grid = signed_distance_grid(mesh, resolution)
    distance = grid.distance.numpy().ravel()
    expected = mesh.signed_distance(points_on(device, centres(resolution))).numpy()
    cell = 2 / resolution
    band = np.abs(expected) < BAND * cell * 0.9999
    np.testing.assert_allclose(np.abs(distance[band]), np.abs(expected[band]), rtol=0, atol=1e-5)
    excess = np.abs(distance) - np.abs(expected)
    assert excess.min() > -1e-5
    assert excess.max() < cell
    assert np.median(excess[~band]) < 0.1 * cell
    # On the surface itself either sign is right.
    off = np.abs(expected) > 1e-6
    np.testing.assert_array_equal(distance[off] < 0, expected[off] < 0)
    assert (grid.columns.doubtful > 0) == (name in OPEN)


def test_grid_of_a_sphere_is_the_sphere(device: wp.Device) -> None:
    distance = signed_distance_grid(query("sphere", device), 64).distance.numpy().ravel()
    exact = np.linalg.norm(centres(64), axis=1) - 0.9
    np.testing.assert_allclose(distance, exact, rtol=0, atol=0.7 * 2 / 64)
    assert np.abs(distance - exact)[np.abs(exact) < 0.05].max() < 3e-3


def test_union_and_cavity_have_the_right_inside(device: wp.Device) -> None:
    points = centres(RESOLUTION)

    def in_box(size: float, centre: tuple[float, float, float]) -> np.ndarray:
        return (np.abs(points - centre) < size / 2).all(axis=1)

    union = in_box(1.0, (-0.3, -0.2, 0.0)) | in_box(0.9, (0.31, 0.2, 0.1))
    shell = in_box(1.6, (0, 0, 0)) & ~in_box(0.77, (0.1, 0.0, 0.0))
    for name, inside in (("overlapping boxes", union), ("cavity", shell)):
        grid = signed_distance_grid(query(name, device), RESOLUTION)
        np.testing.assert_array_equal(grid.distance.numpy().ravel() < 0, inside)
        assert grid.columns.inside == inside.sum()


def test_inverted_mesh_has_nothing_inside_and_says_so(device: wp.Device) -> None:
    grid = signed_distance_grid(query("inverted", device), RESOLUTION)
    assert (grid.distance.numpy() > 0).all()
    assert grid.columns.inverted > 0.2 * RESOLUTION**3
    assert grid.columns.inside == grid.columns.doubtful == 0


def test_same_bytes_on_one_core_and_two(device: wp.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("torus", "open hemisphere"):
        results = []
        for cores in ("1", "2"):
            monkeypatch.setenv("RESFIT_THREADS", cores)
            results.append(signed_distance_grid(query(name, device), 48).distance.numpy().tobytes())
        assert results[0] == results[1]


def test_closest_points_of_a_box(device: wp.Device) -> None:
    mesh = query("box", device)
    found = mesh.closest_points(points_on(device, np.array([[0.95, 0.1, 0.2], [2.0, 2.0, 2.0], [0, 0, 0.8]])))
    np.testing.assert_allclose(found.distance.numpy(), [0.05, 1.1 * 3**0.5, 0.1], atol=1e-6)
    np.testing.assert_allclose(found.point.numpy()[:2], [[0.9, 0.1, 0.2], [0.9, 0.9, 0.9]], atol=1e-6)
    assert make("box")[1].shape[0] > found.face.numpy().max() >= found.face.numpy().min() >= 0


def test_closest_point_beyond_the_search_distance(device: wp.Device) -> None:
    found = query("box", device).closest_points(points_on(device, np.array([[2.0, 0.0, 0.0]])), 0.5)
    assert np.isposinf(found.distance.numpy()).all()
    assert found.face.numpy().tolist() == [-1]
    np.testing.assert_array_equal(found.point.numpy(), [[2.0, 0.0, 0.0]])


def test_signed_distance_of_a_sphere(device: wp.Device, rng: np.random.Generator) -> None:
    points = rng.uniform(-1, 1, (2000, 3))
    distance = query("sphere", device).signed_distance(points_on(device, points)).numpy()
    np.testing.assert_allclose(distance, np.linalg.norm(points, axis=1) - 0.9, atol=4e-3)


def test_rays_hit_the_first_face_from_both_sides(device: wp.Device) -> None:
    origins = np.array([[0.1, 0.2, -3.0], [0.1, 0.2, 0.0], [0.1, 2.0, -3.0]])
    directions = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 2.0], [0.0, 0.0, 2.0]])
    mesh = query("box", device)
    hits = mesh.cast_rays(points_on(device, origins), points_on(device, directions))
    np.testing.assert_allclose(hits.distance.numpy(), [1.05, 0.45, np.inf], atol=1e-6)
    np.testing.assert_allclose(hits.normal.numpy(), [[0, 0, -1], [0, 0, 1], [0, 0, 0]], atol=1e-6)
    assert hits.face.numpy()[2] == -1
    nothing = mesh.cast_rays(points_on(device, origins[:1]), points_on(device, directions[:1]), 1.0)
    assert nothing.face.numpy()[0] == -1


def test_unusable_meshes_are_refused(device: wp.Device) -> None:
    vertices, faces = make("box")
    with pytest.raises(ValueError, match="no faces"):
        MeshQuery(vertices, faces[:0], device)
    with pytest.raises(ValueError, match="outside 0 to 7"):
        MeshQuery(vertices, faces + 1, device)
    with pytest.raises(ValueError, match="finite"):
        MeshQuery(vertices * np.nan, faces, device)
    with pytest.raises(ValueError, match="expected"):
        MeshQuery(vertices[:, :2], faces, device)


def test_unusable_grids_are_refused(device: wp.Device) -> None:
    vertices, faces = make("box")
    with pytest.raises(ValueError, match="resolution"):
        signed_distance_grid(MeshQuery(vertices, faces, device), 1)
    with pytest.raises(ValueError, match="inside the grid"):
        signed_distance_grid(MeshQuery(vertices + 9.0, faces, device), 16)
