"""Sample points of regions: where they lie, and the distance and weight that each has."""

from __future__ import annotations

import numpy as np

from resfit.decomposition.region import Region
from resfit.fitter.propose.region_points import INSIDE_SHARE, OTHER_WEIGHT, OUTSIDE_SHARE, sample_regions

RESOLUTION = 32
SPACING = 2.0 / RESOLUTION
LINE = (np.arange(RESOLUTION) + 0.5) * SPACING - 1.0
X, Y, Z = np.meshgrid(LINE, LINE, LINE, indexing="ij")
GRID = np.maximum(np.maximum(np.abs(X) - 0.5, np.abs(Y) - 0.25), np.abs(Z) - 0.25).astype(np.float32)
"""A bar along x."""


def region(inside: np.ndarray) -> Region:
    low = np.argwhere(inside).min(axis=0)
    high = np.argwhere(inside).max(axis=0) + 1
    mask = inside[tuple(slice(*edges) for edges in zip(low, high, strict=True))]
    return Region(low.astype(np.int32), mask, RESOLUTION, "test")


LEFT, WHOLE = region((GRID < 0) & (X < 0)), region(GRID < 0)


def test_a_point_is_a_cell_centre_with_the_grid_s_distance() -> None:
    found = sample_regions([LEFT], GRID, 640, 3)
    cells = np.round((found.points + 1.0) / SPACING - 0.5).astype(int)
    np.testing.assert_allclose((cells + 0.5) * SPACING - 1.0, found.points, atol=1e-6)
    own = found.weight == 1.0
    np.testing.assert_array_equal(found.distance[own], GRID[tuple(cells[own].T)])
    # The half thickness, less the half cell by which the last centre lies deeper than the surface.
    assert found.scale.tolist() == [0.25 - 0.5 * SPACING]


def test_shares_of_inside_outside_and_other_parts() -> None:
    found = sample_regions([LEFT], GRID, 640, 3)
    inside, other = found.distance < 0, found.weight == np.float32(OTHER_WEIGHT)
    assert inside.sum() == int(640 * INSIDE_SHARE) and (found.points[inside, 0] < 0).all()
    assert other.sum() == int(640 * (1.0 - INSIDE_SHARE - OUTSIDE_SHARE))
    # What the rest of the solid fills should stay free of this region's primitive.
    assert (found.points[other, 0] > 0).all() and (found.distance[other] == np.float32(SPACING)).all()
    outside = ~inside & ~other
    assert (found.distance[outside] > 0).all() and (found.weight[outside] == 1.0).all()


def test_what_is_not_there_has_no_points() -> None:
    """Without other parts there are more outside, without an outside more within."""
    alone = sample_regions([WHOLE], GRID, 640, 3)
    assert (alone.weight == 1.0).all() and (alone.distance < 0).sum() == int(640 * INSIDE_SHARE)
    full = region(np.ones_like(GRID, bool))
    assert (sample_regions([full], np.full_like(GRID, -0.1), 640, 3).distance == np.float32(-0.1)).all()


def test_regions_come_one_after_the_other_and_the_seed_decides() -> None:
    found = sample_regions([LEFT, WHOLE], GRID, 64, 3)
    assert found.region.tolist() == [0] * 64 + [1] * 64 and len(found.scale) == 2
    np.testing.assert_array_equal(sample_regions([LEFT, WHOLE], GRID, 64, 3).points, found.points)
    assert (sample_regions([LEFT, WHOLE], GRID, 64, 4).points != found.points).any()
    half = found.half()
    np.testing.assert_array_equal(half.points, found.points[::2])
    assert half.region.tolist() == [0] * 32 + [1] * 32 and half.scale is found.scale


def test_a_region_of_few_cells_repeats_them() -> None:
    one = Region(np.array([16, 16, 16], np.int32), np.ones((1, 1, 1), bool), RESOLUTION, "test")
    found = sample_regions([one], GRID, 128, 0)
    assert len(found.points) == 128 and len(np.unique(found.points[found.distance < 0], axis=0)) == 1
