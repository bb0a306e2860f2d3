"""Candidates: unfitted seeds as the paper has them, and fits of regions from all their starts."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from scipy.spatial.transform import Rotation

from resfit.decomposition.region import Region, region_from_mask
from resfit.fitter.presets import FitStage, ProposeConfig
from resfit.fitter.propose.candidates import fit_regions, seed_regions
from resfit.kernels.field.evaluate import evaluate_primitives
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.primitives import family
from resfit.kernels.rows import ROTATION, SHAPES, TRANSLATION

RESOLUTION = 48
LINE = (np.arange(RESOLUTION) + 0.5) * (2.0 / RESOLUTION) - 1.0
POINTS = np.stack(np.meshgrid(LINE, LINE, LINE, indexing="ij"), axis=-1).reshape(-1, 3)
TURN = Rotation.from_euler("zx", (25, 40), degrees=True).as_matrix()


def box_distance(
    centre: tuple[float, float, float], size: tuple[float, float, float], turn: np.ndarray
) -> np.ndarray:
    """Of the grid's cells to a turned box, exact within, (n, n, n) float32."""
    local = (POINTS - centre) @ turn
    return (np.abs(local) - 0.5 * np.array(size)).max(axis=1).reshape([RESOLUTION] * 3).astype(np.float32)


def region_of(grid: np.ndarray) -> Region:
    region = region_from_mask(grid < 0, np.zeros(3, np.int32), RESOLUTION, "test")
    assert region is not None
    return region


def test_a_seed_is_swept_along_the_most_cylindrical_axis() -> None:
    """Of a square bar that is its long one, whose extents across are equal."""
    region = region_of(box_distance((0.1, 0.0, -0.2), (0.3, 0.3, 1.2), TURN))
    found = seed_regions([region], "superfrustum")
    assert found.kind == ["seed"] and found.region.tolist() == [0]
    row = found.rows[0]
    np.testing.assert_allclose(row[TRANSLATION : TRANSLATION + 3], [0.1, 0.0, -0.2], atol=0.02)
    sweep = Rotation.from_quat(np.roll(row[ROTATION : ROTATION + 4], -1)).as_matrix()[:, 2]
    assert abs(sweep @ TURN[:, 2]) > 0.999
    # Two axes are free to turn, so that of the profile the diagonal may be measured.
    assert row[SHAPES + 2] == pytest.approx(1.2, abs=0.08)
    assert 0.25 < row[SHAPES] < 0.5 and 0.25 < row[SHAPES + 1] < 0.5
    roundness = family("superfrustum").columns("roundness").start
    assert row[SHAPES + roundness] == 0.5


def test_families_without_roundness_have_seeds_too() -> None:
    region = region_of(box_distance((0.0, 0.0, 0.0), (0.4, 0.6, 0.9), np.eye(3)))
    size = seed_regions([region], "cuboid").rows[0, SHAPES : SHAPES + 3]
    np.testing.assert_allclose(np.sort(size), [0.4, 0.6, 0.9], atol=0.05)


def test_regions_are_fitted_and_the_best_of_each_kept(device: wp.Device) -> None:
    boxes = [((-0.5, 0.0, 0.0), (0.4, 0.6, 0.3), np.eye(3)), ((0.45, 0.1, 0.0), (0.2, 0.3, 0.8), TURN)]
    grids = [box_distance(*entry) for entry in boxes]
    config = ProposeConfig(
        points=512,
        stages=(
            FitStage(sharpness=3.0, iterations=4, keep=4),
            FitStage(sharpness=12.0, iterations=8, keep=2),
        ),
    )
    grid = np.minimum(*grids)
    found = fit_regions([region_of(each) for each in grids], grid, "cuboid", config, 0, device)
    assert len(found) == len(found.kind) == 4 and found.region.tolist() == [0, 0, 1, 1]
    values = evaluate_primitives(PrimitiveSet(found.rows, ["cuboid"] * 4, device), POINTS)
    for index, region in enumerate(found.region):
        inside, wanted = values[index] < 0, grids[region].ravel() < 0
        assert (inside & wanted).sum() / (inside | wanted).sum() > 0.8
