"""Fans over the holes of open patches, kept where they close a solid."""

from __future__ import annotations

import numpy as np
import trimesh
import warp as wp

from resfit.shape.hole_filling import cap_holes


def open_tube(*removed: int) -> tuple[np.ndarray, np.ndarray]:
    """A cylinder of radius 0.4 and height 1.6 without the ends at the signs of z that are named."""
    mesh = trimesh.creation.cylinder(0.4, 1.6, sections=24)
    side = np.round(mesh.triangles_center[:, 2] / 0.8)
    mesh.update_faces(~np.isin(side, removed))
    mesh.remove_unreferenced_vertices()
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def test_a_tube_without_an_end_is_closed(device: wp.Device) -> None:
    vertices, faces = open_tube(1)
    patch = np.full(len(faces), 7)
    capped, fans, owner, left = cap_holes(vertices, faces, patch, device)
    assert left == 0 and len(fans) == 24 and (owner == 7).all()
    np.testing.assert_array_equal(capped[: len(vertices)], vertices)
    np.testing.assert_allclose(capped[len(vertices) :], [[0.0, 0.0, 0.8]], atol=1e-12)
    whole = trimesh.Trimesh(capped, np.concatenate([faces, fans]), process=False)
    assert whole.is_watertight and whole.is_winding_consistent
    expected = 0.5 * 24 * np.sin(2 * np.pi / 24) * 0.4**2 * 1.6
    assert abs(whole.volume - expected) < 1e-9


def test_each_hole_has_a_middle_of_its_own(device: wp.Device) -> None:
    vertices, faces = open_tube(1, -1)
    capped, fans, _, left = cap_holes(vertices, faces, np.zeros(len(faces), int), device)
    assert left == 0 and len(fans) == 48
    assert sorted(capped[len(vertices) :, 2].round(9)) == [-0.8, 0.8]


def test_panels_of_a_body_are_not_capped(device: wp.Device) -> None:
    """The caps of either half would cut through the inside, where the other half winds, too."""
    mesh = trimesh.creation.box((1.0, 1.0, 1.0)).subdivide()
    patch = (mesh.triangles_center[:, 2] > 0.0).astype(int)
    _, fans, owner, left = cap_holes(mesh.vertices, mesh.faces, patch, device)
    assert len(fans) == len(owner) == 0 and left == 2


def test_a_closed_mesh_stays_as_it_is(device: wp.Device) -> None:
    mesh = trimesh.creation.box()
    vertices, fans, owner, left = cap_holes(mesh.vertices, mesh.faces, np.zeros(12, int), device)
    assert vertices is mesh.vertices and fans.shape == (0, 3) and len(owner) == 0 and left == 0
