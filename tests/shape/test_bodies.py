"""Sorting faces into closed bodies, open patches and walls, and turning bodies outwards."""

from __future__ import annotations

import numpy as np
import trimesh
import warp as wp

from resfit.shape.bodies import Bodies, sort_bodies


def box(side: float, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> trimesh.Trimesh:
    """A cube, its faces counter-clockwise seen from outside."""
    return trimesh.creation.box((side,) * 3, trimesh.transformations.translation_matrix(centre))


def sorted_of(device: wp.Device, *meshes: trimesh.Trimesh) -> tuple[Bodies, np.ndarray]:
    """Bodies of some meshes together, and the vertices."""
    mesh = trimesh.util.concatenate(list(meshes))
    return sort_bodies(mesh.vertices, mesh.faces, device), np.asarray(mesh.vertices)


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    return float(trimesh.Trimesh(vertices, faces, process=False).volume)


def test_a_cube_is_one_body_as_it_is(device: wp.Device) -> None:
    found, _ = sorted_of(device, box(1.0))
    assert found.closed.all() and not found.open.any() and not found.walls.any()
    np.testing.assert_array_equal(found.faces, box(1.0).faces)
    assert (found.body_count, found.cavity_count, found.turned_count, found.inverted_count) == (1, 0, 0, 0)


def test_one_face_wound_the_wrong_way_is_turned(device: wp.Device) -> None:
    wrong = box(1.0)
    wrong.faces[3] = wrong.faces[3][::-1]
    found, vertices = sorted_of(device, wrong)
    assert found.turned_count == 1 and found.closed.all()
    assert abs(volume(vertices, found.faces) - 1.0) < 1e-12


def test_a_body_inside_out_is_turned_outwards(device: wp.Device) -> None:
    inverted = box(0.5, (0.6, 0.0, 0.0))
    inverted.invert()
    found, vertices = sorted_of(device, box(0.5), inverted)
    assert found.inverted_count == 1 and found.body_count == 2 and found.cavity_count == 0
    assert abs(volume(vertices, found.faces) - 0.25) < 1e-12


def test_an_inward_body_within_another_is_a_cavity(device: wp.Device) -> None:
    hole = box(0.5)
    hole.invert()
    found, vertices = sorted_of(device, box(1.0), hole)
    assert (found.body_count, found.cavity_count, found.inverted_count) == (2, 1, 0)
    assert abs(volume(vertices, found.faces) - (1.0 - 0.125)) < 1e-12


def test_a_cube_without_lid_is_an_open_patch(device: wp.Device) -> None:
    mesh = box(1.0)
    mesh.update_faces(mesh.triangles_center[:, 2] < 0.49)
    found, _ = sorted_of(device, mesh, box(0.2, (3.0, 0.0, 0.0)))
    assert found.open.sum() == 10 and found.closed.sum() == 12 and found.body_count == 1
    assert len(np.unique(found.patch[found.open])) == 1
    assert set(found.patch[found.open]).isdisjoint(found.patch[found.closed])


def test_faces_back_to_back_across_a_body_are_a_wall(device: wp.Device) -> None:
    """A quad through the middle of a box, drawn from both sides: one side of it is kept as a wall."""
    vertices = np.array([[x, y, z] for x in (0, 1, 2) for y in (0, 1) for z in (0, 1)], float)
    hull = [(0, 1, 3, 2), (8, 10, 11, 9), (0, 4, 5, 1), (4, 8, 9, 5), (2, 3, 7, 6), (6, 7, 11, 10)]
    hull += [(0, 2, 6, 4), (4, 6, 10, 8), (1, 5, 7, 3), (5, 9, 11, 7)]
    quads = [*hull, (4, 6, 7, 5), (4, 5, 7, 6)]
    faces = np.array([(a, b, c) for a, b, c, d in quads] + [(a, c, d) for a, b, c, d in quads])
    wall = np.array([set(face) <= {4, 5, 6, 7} for face in faces.tolist()])
    # The second side has its diagonal the other way, so that each face has a twin.
    faces[wall] = [(4, 6, 7), (4, 7, 6), (4, 7, 5), (4, 5, 7)]
    found = sort_bodies(vertices, faces, device)
    assert (found.closed == ~wall).all() and not found.open.any()
    assert found.walls.sum() == 2 and (found.walls <= wall).all()
    assert found.body_count == 1


def test_a_sheet_with_two_sides_is_no_body(device: wp.Device) -> None:
    flat = box(1.0)
    flat.vertices *= (1.0, 1.0, 1e-9)
    found, _ = sorted_of(device, flat, box(0.5, (3.0, 0.0, 0.0)))
    assert found.walls.sum() == 12 and found.closed.sum() == 12 and found.body_count == 1
