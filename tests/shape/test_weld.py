"""Welding of vertices and what makes a face worth keeping."""

from __future__ import annotations

import numpy as np
import pytest

from resfit.errors import InputError
from resfit.shape.weld import WELD_STEPS, clean_faces, face_areas, has_area, weld_vertices

TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def test_vertices_of_a_soup_become_one() -> None:
    soup = np.concatenate([TRIANGLE, TRIANGLE[::-1] + 1e-8])
    vertices, faces = weld_vertices(soup, np.arange(6).reshape(-1, 3))
    assert len(vertices) == 3
    # Each is one of the first triangle's, at its exact position.
    np.testing.assert_array_equal(vertices[faces[0]], TRIANGLE)
    np.testing.assert_array_equal(vertices[faces[1]], TRIANGLE[::-1])


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_welding_is_relative_to_the_size(scale: float, offset: float) -> None:
    apart = np.concatenate([TRIANGLE, [[10.0 / WELD_STEPS, 0.0, 0.0]]]) * scale + offset * scale
    vertices, faces = weld_vertices(apart, np.array([[0, 1, 2], [3, 1, 2]]))
    assert len(vertices) == 4 and faces.shape == (2, 3)


def test_vertices_without_a_face_are_left_out() -> None:
    vertices, _ = weld_vertices(np.concatenate([TRIANGLE, [[np.nan, 7.0, 7.0]]]), np.array([[0, 1, 2]]))
    assert sorted(vertices.tolist()) == sorted(TRIANGLE.tolist())


@pytest.mark.parametrize(
    ("scale", "sentence"),
    [
        (0.0, "all vertices of 'a.stl' are at one place: there is no shape in it."),
        (1e-300, "the bounding box of 'a.stl' is too small for floating-point numbers; scale it up."),
        (1e308, "the bounding box of 'a.stl' is too large for floating-point numbers; scale it down."),
    ],
)
def test_sizes_that_cannot_be_computed_with(scale: float, sentence: str) -> None:
    corners = (TRIANGLE * 3.0 - 1.5) * scale
    with pytest.raises(InputError) as caught:
        weld_vertices(corners, np.array([[0, 1, 2]]), "'a.stl'")
    assert str(caught.value) == sentence


def test_degenerate_and_repeated_faces_are_dropped() -> None:
    faces = np.array([[0, 1, 2], [1, 2, 0], [0, 0, 2], [2, 1, 0], [3, 4, 4], [0, 1, 2]])
    kept, notes = clean_faces(faces)
    # The third is degenerate; the fourth is the first seen from behind, which is another face.
    assert kept.tolist() == [0, 3]
    assert notes == ["2 faces without area were dropped.", "2 repeated faces were dropped."]
    assert clean_faces(faces[:1]) == ([0], []) and clean_faces(faces[2:4])[1] == [
        "1 face without area was dropped."
    ]


def test_areas_and_widths() -> None:
    needle = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1e-3, 0.0]])
    face = np.array([[0, 1, 2]])
    np.testing.assert_allclose(face_areas(TRIANGLE, face), 0.5)
    np.testing.assert_allclose(face_areas(needle, face), 5e-4)
    assert face_areas(TRIANGLE * 1e200, face)[0] == np.inf
    assert has_area(needle, face) and has_area(needle, face, 0.9e-3) and not has_area(needle, face, 1.1e-3)
    assert not has_area(needle * (1.0, 0.0, 1.0), face)
