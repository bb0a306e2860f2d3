"""Polygons cut into triangles: area, orientation and edges are those of the polygon, whatever its form."""

from __future__ import annotations

import numpy as np
import pytest

from resfit.shape.formats.polygons import MANY_CORNERS, triangulate

U = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]
FORMS = {
    "square": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "arrow": [(0, 10), (-1, 0), (0, 1), (1, 0)],
    "u": U,
    "u from a reflex corner": U[4:] + U[:4],
    "u with corners on its edges": [
        (0, 0),
        (1, 0),
        (2, 0),
        (3, 0),
        (3, 2),
        *U[2:5],
        (1.5, 1),
        *U[5:],
        (0, 2),
        (0, 1),
    ],
    "comb": [(x, y) for k in range(20) for x, y in [(2 * k, 0), (2 * k + 0.5, 5), (2 * k + 1, 0.1)]]
    + [(40, -1), (20, -1), (0, -1)],
}


def area(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (points[faces[:, k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a).sum(axis=0)


def ring_area(ring: np.ndarray) -> np.ndarray:
    return 0.5 * np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("name", FORMS)
def test_triangles_cover_the_polygon_once(name: str, turned: bool, rng: np.random.Generator) -> None:
    flat = np.array(FORMS[name], float)
    basis = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    ring = 1e-3 * (np.c_[flat, np.zeros(len(flat))] @ basis.T) + 7.0
    ring = ring[::-1] if turned else ring
    count = len(ring)
    faces, owner = triangulate(ring, np.arange(count), np.array([count]))
    assert len(faces) == count - 2 and set(owner) == {0}
    assert np.allclose(area(ring, faces), ring_area(ring), atol=1e-12)
    # Positively oriented triangles whose areas add up to the polygon's can't overlap or leave it.
    normal = ring_area(ring) / np.linalg.norm(ring_area(ring))
    assert all(area(ring, face[None]) @ normal >= -1e-12 for face in faces)
    edges = {(int(face[k]), int(face[(k + 1) % 3])) for face in faces for k in range(3)}
    outline = {(k, (k + 1) % count) for k in range(count)}
    assert {edge for edge in edges if edge[::-1] not in edges} == outline


def test_order_and_owners_of_mixed_polygons() -> None:
    points = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 2, 1)], float)
    corners = np.array([0, 1, 2, 3, 0, 1, 4, 0, 1, 1, 2, 3, 4])
    faces, owner = triangulate(points, corners, np.array([4, 3, 2, 4]))
    assert owner.tolist() == [0, 0, 1, 3, 3]
    assert faces[:3].tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 4]]


def test_nothing_gives_nothing() -> None:
    faces, owner = triangulate(np.zeros((3, 3)), np.zeros(0, int), np.zeros(0, int))
    assert faces.shape == (0, 3) and owner.shape == (0,)


@pytest.mark.parametrize(
    "ring",
    [
        [(0, 0), (1, 1), (1, 0), (0, 1)],
        [(0, 0), (0, 0), (0, 0), (0, 0)],
        [(0, 0), (1, 0), (2, 0), (3, 0)],
        [(0, 0), (4, 0), (4, 1), (1, np.nan), (0, 3)],
        [(0, 0), (2, 0), (1, 0), (1, 2), (1, 0), (0.5, 0.5)],
    ],
)
def test_degenerate_polygons_end_in_triangles(ring: list[tuple[float, float]]) -> None:
    points = np.c_[np.array(ring, float), np.zeros(len(ring))]
    with np.errstate(invalid="ignore"):
        faces, _ = triangulate(points, np.arange(len(ring)), np.array([len(ring)]))
    assert len(faces) == len(ring) - 2


def test_of_a_polygon_of_very_many_corners_few_triangles_are_long() -> None:
    count = 2 * MANY_CORNERS
    angle = 2.0 * np.pi * np.arange(count) / count
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    faces, _ = triangulate(ring, np.arange(count), np.array([count]))
    assert len(faces) == count - 2
    np.testing.assert_allclose(area(ring, faces), ring_area(ring), atol=1e-12)
    edges = {(int(face[k]), int(face[(k + 1) % 3])) for face in faces for k in range(3)}
    outline = {(k, (k + 1) % count) for k in range(count)}
    assert {edge for edge in edges if edge[::-1] not in edges} == outline
    sides = np.linalg.norm(ring[faces] - np.roll(ring[faces], 1, axis=1), axis=2).max(axis=1)
    assert np.count_nonzero(sides > 0.5) < 40
