"""Specks: what is far away and next to nothing is left out and named; everything else stays."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from trimesh import creation

from resfit.shape.load import load_mesh
from resfit.shape.specks import find_specks


def moved(mesh: trimesh.Trimesh, *offset: float) -> trimesh.Trimesh:
    mesh.apply_translation(offset)
    return mesh


def specks_of(*meshes: trimesh.Trimesh) -> tuple[int, str]:
    mesh = trimesh.util.concatenate(list(meshes))
    specks, sentence = find_specks(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    # The same without any shared vertices, as STL stores it.
    soup, _ = find_specks(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size).reshape(-1, 3))
    assert np.array_equal(specks, soup)
    assert bool(sentence) == bool(specks.any())
    return int(specks.sum()), sentence


def triangle(size: float = 0.1) -> trimesh.Trimesh:
    return trimesh.Trimesh(size * np.eye(3), [[0, 1, 2]], process=False)


@pytest.mark.parametrize("distance", [30.0, 400.0, 1e7])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_far_triangle_is_left_out(distance: float, scale: float) -> None:
    ball, speck = creation.icosphere(subdivisions=3), moved(triangle(), 0.0, distance, 0.0)
    mesh = trimesh.util.concatenate([ball, speck]).apply_scale(scale)
    loaded = load_mesh(mesh)
    assert np.ptp(loaded.vertices, axis=0) == pytest.approx(2.0 * scale, rel=1e-6)
    assert len(loaded.faces) == len(ball.faces)
    (note,) = loaded.notes
    assert note.startswith("1 face, ") and note.endswith("of the surface, was left out.")


def test_several_specks_are_counted() -> None:
    ball = creation.icosphere(subdivisions=3)
    far = [moved(triangle(), 0.0, 50.0, 0.0), moved(creation.box((0.1, 0.1, 0.1)), -90.0, 0.0, 0.0)]
    count, sentence = specks_of(ball, *far)
    assert count == 13 and sentence.startswith("13 faces in 2 pieces, 49")


def test_faces_of_the_input_keep_their_order() -> None:
    box = creation.box()
    mesh = load_mesh(trimesh.util.concatenate([moved(triangle(), 500.0, 0.0, 0.0), box]))
    np.testing.assert_allclose(mesh.vertices[mesh.faces], box.triangles)


def test_what_is_near_or_large_or_connected_stays() -> None:
    ball = creation.icosphere(subdivisions=3)
    assert specks_of(ball, moved(triangle(), 0.0, 2.5, 0.0))[0] == 0
    assert specks_of(ball, moved(creation.icosphere(radius=0.3), 0.0, 90.0, 0.0))[0] == 0
    assert specks_of(ball, moved(creation.icosphere(), 400.0, 0.0, 0.0))[0] == 0
    needle = trimesh.Trimesh([*ball.vertices[:2], (0.0, 0.0, 400.0)], [[0, 1, 2]], process=False)
    needle.vertices[:, :2] *= 1e-4
    spike = trimesh.Trimesh(
        [*ball.vertices[ball.faces[0]][:2], (300.0, 0.0, 0.0)], [[0, 1, 2]], process=False
    )
    assert specks_of(ball, spike)[0] == 0


def test_a_small_solid_beside_a_large_sheet_stays() -> None:
    sheet = trimesh.Trimesh(
        [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [[0, 1, 2], [0, 2, 3]], process=False
    )
    assert specks_of(sheet, moved(creation.box((0.02, 0.02, 0.02)), 30.0, 0.0, 0.0))[0] == 0
    assert specks_of(sheet, moved(triangle(0.01), 30.0, 0.0, 0.0))[0] == 1


@pytest.mark.parametrize("count", [1, 40, 3000])
def test_soups_and_dust_stay(count: int, rng: np.random.Generator) -> None:
    middles = rng.normal(size=(count, 1, 3)) * 10.0 ** rng.uniform(-2.0, 0.0, size=(count, 1, 1))
    soup = (middles + 0.01 * rng.normal(size=(count, 3, 3))).reshape(-1, 3)
    specks, _ = find_specks(soup, np.arange(3 * count).reshape(-1, 3))
    assert not specks.any()
