"""The Euclidean distance transform against SciPy's, on grids of every kind."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from scipy import ndimage

from resfit.kernels.grid import distance_grid

SHAPES = [(1, 1, 1), (5, 7, 9), (33, 17, 64), (64, 64, 64), (40, 40, 3), (3, 100, 70), (2, 33, 1), (1, 1, 50)]


def transform(mask: np.ndarray, device: wp.Device) -> np.ndarray:
    return distance_grid.distance_transform(wp.array(mask, dtype=wp.bool, device=device)).numpy()


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("share", [0.001, 0.05, 0.6])
def test_distances_equal_scipy(
    shape: tuple[int, int, int], share: float, device: wp.Device, rng: np.random.Generator
) -> None:
    mask = rng.random(shape) < share
    mask[tuple(rng.integers(shape))] = True
    expected = ndimage.distance_transform_edt(~mask)
    np.testing.assert_allclose(transform(mask, device), expected, rtol=0, atol=1e-5)


def test_thin_sheet_and_single_corner(device: wp.Device) -> None:
    for place in (np.s_[:, 20, :], np.s_[0, 0, 0], np.s_[-1, -1, -1], np.s_[10, :, 3]):
        mask = np.zeros((37, 41, 29), bool)
        mask[place] = True
        expected = ndimage.distance_transform_edt(~mask)
        np.testing.assert_allclose(transform(mask, device), expected, rtol=0, atol=1e-5)


def test_grid_without_true_cells_is_infinitely_far(device: wp.Device) -> None:
    assert np.isposinf(transform(np.zeros((9, 8, 40), bool), device)).all()
    assert (transform(np.ones((9, 8, 40), bool), device) == 0).all()


def test_nearest_cells_are_true_and_at_the_distance(device: wp.Device, rng: np.random.Generator) -> None:
    mask = rng.random((20, 33, 34)) < 0.01
    packed = distance_grid.nearest_true_cells(wp.array(mask, dtype=wp.bool, device=device)).numpy()
    near = np.stack([packed >> 20, (packed >> 10) & 1023, packed & 1023], axis=-1)
    assert mask[tuple(near.reshape(-1, 3).T)].all()
    cells = np.stack(np.indices(mask.shape), axis=-1)
    measured = np.linalg.norm(near - cells, axis=-1)
    np.testing.assert_allclose(measured, ndimage.distance_transform_edt(~mask), rtol=0, atol=1e-9)


def test_signed_distance_is_negative_inside_and_scaled(device: wp.Device, rng: np.random.Generator) -> None:
    inside = rng.random((31, 20, 36)) < 0.4
    signed = distance_grid.signed_distance_transform(wp.array(inside, dtype=wp.bool, device=device), 0.25)
    depth, height = ndimage.distance_transform_edt(inside), ndimage.distance_transform_edt(~inside)
    expected = 0.25 * np.where(inside, 0.5 - depth, height - 0.5)
    np.testing.assert_allclose(signed.numpy(), expected, rtol=0, atol=1e-5)


def test_signed_distance_of_empty_and_full_grids(device: wp.Device) -> None:
    for value, expected in ((False, np.inf), (True, -np.inf)):
        inside = wp.array(np.full((4, 5, 6), value), dtype=wp.bool, device=device)
        assert (distance_grid.signed_distance_transform(inside).numpy() == expected).all()


def test_same_bytes_on_one_core_and_two(device: wp.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    mask = np.random.default_rng(3).random((70, 66, 67)) < 0.003
    results = []
    for cores in ("1", "2"):
        monkeypatch.setenv("RESFIT_THREADS", cores)
        results.append(transform(mask, device))
    assert results[0].tobytes() == results[1].tobytes()


def test_wrong_masks_are_refused(device: wp.Device) -> None:
    with pytest.raises(ValueError, match="bool"):
        distance_grid.distance_transform(wp.zeros((3, 3, 3), dtype=float, device=device))
    with pytest.raises(ValueError, match="bool"):
        distance_grid.distance_transform(wp.zeros((3, 3), dtype=wp.bool, device=device))
    with pytest.raises(ValueError, match="1024"):
        distance_grid.distance_transform(wp.zeros((1, 1, 1025), dtype=wp.bool, device=device))
