"""Through-holes: counted on cells as topology counts them, and those that an assembly fills."""

from __future__ import annotations

import numpy as np
import pytest
from skimage.measure import euler_number
from trimesh import creation

from resfit.eval.metrics.through_holes import count_through_holes, euler_characteristic, filled_holes

GRID = np.stack(np.meshgrid(*[np.linspace(-1, 1, 40)] * 3, indexing="ij"), axis=-1)


def bores(*centres: tuple[float, float], radius: float = 0.15) -> np.ndarray:
    x, y = GRID[..., 0], GRID[..., 1]
    found = np.zeros(x.shape, bool)
    for a, b in centres:
        found |= (x - a) ** 2 + (y - b) ** 2 < radius**2
    return found


PLATE = np.abs(GRID).max(axis=-1, where=np.array([True, True, False]), initial=0.0) < 0.9
PLATE &= np.abs(GRID[..., 2]) < 0.2
FOUR = bores((0.5, 0.5), (-0.5, 0.5), (0.5, -0.5), (-0.5, -0.5))
RADIUS = np.linalg.norm(GRID, axis=-1)


@pytest.mark.parametrize(
    ("inside", "holes"),
    [
        (PLATE, 0),
        (PLATE & ~FOUR, 4),
        (RADIUS < 0.8, 0),
        ((RADIUS < 0.8) & (RADIUS > 0.5), 0),
        ((np.hypot(np.hypot(GRID[..., 0], GRID[..., 1]) - 0.6, GRID[..., 2]) < 0.2), 1),
        (PLATE & ~FOUR | (GRID[..., 2] > 0.5) & (RADIUS < 0.9), 4),
        (np.zeros((4, 4, 4), bool), 0),
    ],
)
def test_counts(inside: np.ndarray, holes: int) -> None:
    assert count_through_holes(inside) == holes


def test_euler_characteristic_is_that_of_scikit_image(rng: np.random.Generator) -> None:
    for share in (0.1, 0.5, 0.9):
        inside = np.pad(rng.random((9, 10, 11)) < share, 1)
        assert euler_characteristic(inside) == euler_number(inside, connectivity=3)


def test_filled_holes_of_a_plate() -> None:
    faces = np.asarray(creation.annulus(0.2, 1.0, 1.0).faces)
    target = PLATE & ~FOUR
    assert filled_holes(faces, target, PLATE) == 4
    assert filled_holes(faces, target, PLATE & ~bores((0.5, 0.5), (-0.5, -0.5))) == 2
    assert filled_holes(faces, target, target) == 0
    # Gaps of an assembly, and holes of its own, fill none.
    assert filled_holes(faces, target, target & (np.abs(GRID[..., 0]) > 0.05)) == 0
    assert filled_holes(faces, target, np.zeros_like(target)) == 0


def test_meshes_of_genus_0_are_not_counted() -> None:
    two = np.concatenate([faces := np.asarray(creation.icosphere(1).faces), faces + faces.max() + 1])
    assert filled_holes(two, PLATE & ~FOUR, PLATE) == 0
