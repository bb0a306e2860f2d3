"""What the solid of a mesh is decided to be, and its distances, against solids that are known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import warp as wp
from trimesh import creation
from work import calls_of

from resfit.assembly.transform import Transform
from resfit.shape.grid import distance_grid
from resfit.shape.load import load_mesh
from resfit.shape.outer_surface import OFFSET, _beside_others
from resfit.shape.solid import SHEET_THICKNESS, decide_solid
from resfit.shape.solid_query import SolidQuery


def box(size: float, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> trimesh.Trimesh:
    mesh = creation.box(extents=(size, size, size))
    mesh.apply_translation(centre)
    return mesh


def inverted(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh = mesh.copy()
    mesh.invert()
    return mesh


def decide(*meshes: trimesh.Trimesh, device: wp.Device) -> SolidQuery:
    """The solid of some meshes together; they must fill the box of side 1.8 about the origin."""
    mesh = load_mesh(trimesh.util.concatenate(list(meshes)))
    bounds = Transform.from_bounds(mesh.vertices.min(axis=0), mesh.vertices.max(axis=0))
    return decide_solid(bounds.to_normalised(mesh.vertices), mesh.faces, bounds.scale, device)


def ball() -> trimesh.Trimesh:
    return creation.icosphere(subdivisions=3, radius=0.9)


POINTS = np.random.default_rng(3).uniform(-1.0, 1.0, (2000, 3))


def inside(query: SolidQuery, points: np.ndarray = POINTS) -> np.ndarray:
    return query.signed_distance(points) < 0.0


def in_box(
    points: np.ndarray, size: float, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> np.ndarray:
    return (np.abs(points - np.asarray(centre)) < 0.5 * size).all(axis=1)


def test_closed_mesh_is_taken_as_it_is(device: wp.Device) -> None:
    query = decide(ball(), device=device)
    assert query.solid.kind == "closed"
    assert query.solid.boundary_faces is query.solid.winding_faces
    assert "as it is" in query.solid.sentence
    distance = np.linalg.norm(POINTS, axis=1) - 0.9
    np.testing.assert_allclose(query.signed_distance(POINTS), distance, atol=0.012)


def test_inverted_mesh_is_turned_outwards(device: wp.Device) -> None:
    query = decide(inverted(ball()), device=device)
    assert query.solid.kind == "flipped"
    np.testing.assert_array_equal(inside(query), inside(decide(ball(), device=device)))


def test_one_of_two_bodies_inverted(device: wp.Device) -> None:
    left, right = (-0.6, 0.0, 0.0), (0.6, 0.0, 0.0)
    query = decide(box(0.6, left), inverted(box(0.6, right)), device=device)
    assert query.solid.kind == "flipped"
    assert "1 body inside out" in query.solid.sentence
    np.testing.assert_array_equal(inside(query), in_box(POINTS, 0.6, left) | in_box(POINTS, 0.6, right))


def test_mixed_winding_is_reoriented(device: wp.Device) -> None:
    mesh = ball()
    mesh.faces[::3] = mesh.faces[::3, ::-1]
    query = decide(mesh, device=device)
    assert query.solid.kind == "reoriented"
    np.testing.assert_array_equal(inside(query), inside(decide(ball(), device=device)))


def test_overlapping_bodies_are_one_without_inner_faces(device: wp.Device) -> None:
    left, right = (-0.3, 0.0, 0.0), (0.3, 0.0, 0.0)
    query = decide(box(1.2, left), box(1.2, right), device=device)
    assert query.solid.kind == "union"
    np.testing.assert_array_equal(inside(query), in_box(POINTS, 1.2, left) | in_box(POINTS, 1.2, right))
    # The middle is 0.6 from the surface of the union, and 0.3 from the faces that are inside.
    assert query.signed_distance(np.zeros((1, 3)))[0] == pytest.approx(-0.6, abs=1e-3)


def test_touching_boxes_lose_the_wall_between(device: wp.Device) -> None:
    query = decide(box(0.9, (-0.45, 0.0, 0.0)), box(0.9, (0.45, 0.0, 0.0)), device=device)
    assert query.signed_distance(np.zeros((1, 3)))[0] == pytest.approx(-0.45, abs=1e-3)


@pytest.mark.parametrize("flip_all", [False, True])
def test_cavities_stay_and_nested_bodies_join(device: wp.Device, flip_all: bool) -> None:
    meshes = [box(1.8), inverted(box(1.0, (0.1, 0.0, 0.0)))]
    if flip_all:
        meshes = [inverted(mesh) for mesh in meshes]
    hollow = decide(*meshes, device=device)
    assert "1 cavity" in hollow.solid.sentence
    np.testing.assert_array_equal(inside(hollow), in_box(POINTS, 1.8) & ~in_box(POINTS, 1.0, (0.1, 0.0, 0.0)))
    full = decide(box(1.8), box(1.0, (0.1, 0.0, 0.0)), device=device)
    assert full.solid.kind == "union"
    np.testing.assert_array_equal(inside(full), in_box(POINTS, 1.8))
    assert len(full.solid.boundary_faces) == 12


def test_small_holes_are_closed(device: wp.Device) -> None:
    mesh = ball()
    middle = mesh.triangles_center
    mesh.update_faces((middle[:, 2] < 0.86) & (middle[:, 0] > -0.86))
    query = decide(mesh, device=device)
    assert query.solid.kind == "winding"
    assert "2 holes closed" in query.solid.sentence
    far = np.abs(np.linalg.norm(POINTS, axis=1) - 0.88) > 0.06
    np.testing.assert_array_equal(inside(query)[far], (np.linalg.norm(POINTS, axis=1) < 0.88)[far])
    # Under the hole the distance is to where the surface would be.
    assert query.signed_distance(np.array([[0.0, 0.0, 0.8]]))[0] == pytest.approx(-0.06, abs=0.05)


def test_unwelded_panels_with_gaps_enclose(device: wp.Device) -> None:
    mesh = box(1.8)
    panels = [mesh.submesh([np.flatnonzero(mesh.face_normals @ axis > 0.9)], append=True)
              for axis in np.concatenate([np.eye(3), -np.eye(3)])]  # fmt: skip
    for index, panel in enumerate(panels):
        panel.apply_translation(-panel.centroid * 0.01)
        if index % 2:
            panel.invert()
    query = decide(*panels, device=device)
    assert "flooding" in query.solid.sentence
    assert inside(query)[in_box(POINTS, 1.75)].all()
    assert not inside(query)[~in_box(POINTS, 1.83)].any()


def test_open_sheet_becomes_a_shell(device: wp.Device) -> None:
    x, y = np.meshgrid(np.linspace(-0.9, 0.9, 20), np.linspace(-0.9, 0.9, 20))
    sheet = trimesh.Trimesh(
        np.stack([x, y, 0.1 * np.sin(3 * x)], axis=-1).reshape(-1, 3), creation_grid_faces(20), process=False
    )
    query = decide(sheet, device=device)
    assert query.solid.kind == "shell"
    assert "shell 0.018 mesh units thick" in query.solid.sentence
    on = np.stack([np.linspace(-0.8, 0.8, 9), np.full(9, 0.3)], axis=1)
    above = np.column_stack([on, 0.1 * np.sin(3 * on[:, 0])])
    np.testing.assert_allclose(query.signed_distance(above), -0.5 * SHEET_THICKNESS, atol=2e-3)
    above[:, 2] += 0.1
    assert (query.signed_distance(above) > 0.07).all()


def creation_grid_faces(side: int) -> np.ndarray:
    """Triangles of a grid of side x side vertices."""
    index = np.arange(side * side).reshape(side, side)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def test_sheet_beside_a_body_is_kept_and_one_inside_left_out(device: wp.Device) -> None:
    flag = trimesh.Trimesh([[0.9, 0, 0], [1.5, 0, 0], [1.5, 0, 0.5]], [[0, 1, 2]], process=False)
    decal = trimesh.Trimesh([[-0.3, 0, 0.1], [0.3, 0, 0], [0.3, 0, 0.4]], [[0, 1, 2]], process=False)
    query = decide(box(1.8), flag, decal, device=device)
    assert query.solid.kind == "mixed"
    assert len(query.solid.sheet_faces) == 1
    assert "1 face inside or on the solid left out" in query.solid.sentence


def test_double_sided_faces(device: wp.Device) -> None:
    twice = trimesh.util.concatenate([box(1.8), inverted(box(1.8))])
    np.testing.assert_array_equal(inside(decide(twice, device=device)), in_box(POINTS, 1.8))
    card = trimesh.Trimesh(
        [[-0.9, -0.9, 0], [0.9, -0.9, 0], [0.9, 0.9, 0]], [[0, 1, 2], [0, 2, 1]], process=False
    )
    assert decide(card, device=device).solid.kind == "shell"


def test_soup_is_a_shell_and_deciding_is_repeatable(device: wp.Device) -> None:
    rng = np.random.default_rng(5)
    corners = rng.uniform(-0.7, 0.7, (20, 1, 3)) + rng.uniform(-0.2, 0.2, (20, 3, 3))
    mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(60).reshape(-1, 3), process=False)
    first, second = decide(mesh, device=device), decide(mesh, device=device)
    assert first.solid.kind == "shell"
    assert first.solid.sentence == second.solid.sentence
    np.testing.assert_array_equal(first.signed_distance(POINTS), second.signed_distance(POINTS))


@pytest.mark.parametrize("resolution", [32, 128])
def test_grid_agrees_with_points(device: wp.Device, resolution: int) -> None:
    flag = trimesh.Trimesh([[0.3, 0, 0], [1.5, 0, 0], [1.5, 0, 0.5]], [[0, 1, 2]], process=False)
    query = decide(box(1.2, (-0.3, 0.0, 0.0)), box(0.6, (0.3, 0.0, 0.1)), flag, device=device)
    grid = distance_grid(query, resolution)
    assert grid.shape == (resolution,) * 3
    assert grid.dtype == np.float32
    cells = np.random.default_rng(1).integers(0, resolution, (3000, 3))
    exact = query.signed_distance((2.0 * cells + 1.0) / resolution - 1.0)
    found = grid[tuple(cells.T)]
    band = np.abs(exact) < 2.0 / resolution
    np.testing.assert_allclose(found[band], exact[band], atol=1e-5)
    np.testing.assert_array_equal(found < 0.0, exact < 0.0)
    assert (np.abs(found) >= np.abs(exact) - 1e-5).all()


def test_bodies_beside_each_other_are_found_all_at_once(rng: np.random.Generator) -> None:
    count = 150
    triangles = 0.4 * box(1.0).triangles + rng.uniform(-0.5, 0.5, (count, 1, 1, 3))
    body = np.repeat(np.arange(count), 12)
    triangles = triangles.reshape(-1, 3, 3)
    low, high = triangles.min(axis=1) - OFFSET, triangles.max(axis=1) + OFFSET
    box_low = np.stack([low[body == index].min(axis=0) for index in range(count)])
    box_high = np.stack([high[body == index].max(axis=0) for index in range(count)])
    reaches = ((low[:, None] <= box_high) & (high[:, None] >= box_low)).all(axis=2)
    reaches[np.arange(len(body)), body] = False
    found: list[np.ndarray] = []
    calls = calls_of(lambda: found.append(_beside_others(triangles, body)))
    np.testing.assert_array_equal(found[0], reaches.any(axis=1))
    assert calls < 60 * count
