"""Marching Primitives find shapes that they can express, the same ones every time."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from resfit.eval.methods.marching_fit import FAMILY
from resfit.eval.methods.marching_levels import MarchingConfig, march
from resfit.eval.methods.marching_primitives import readme_grid
from resfit.eval.methods.marching_regions import region_candidates, regions_below
from resfit.kernels.field.evaluate import cell_centres, evaluate_grid
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.rows import ROTATION, SHAPES, empty_rows

RESOLUTION = 64


def centres(resolution: int = RESOLUTION) -> np.ndarray:
    """Cell centres (n, n, n, 3) of [-1, 1]^3."""
    axis = (np.arange(resolution) + 0.5) * (2.0 / resolution) - 1.0
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)


def box(half: tuple[float, float, float], centre: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    """Exact signed distance of a box at the cell centres."""
    q = np.abs(centres() - centre) - half
    return np.linalg.norm(np.maximum(q, 0.0), axis=-1) + np.minimum(q.max(axis=-1), 0.0)


def ball(radius: float, centre: tuple[float, float, float]) -> np.ndarray:
    """Exact signed distance of a ball at the cell centres."""
    return np.linalg.norm(centres() - centre, axis=-1) - radius


def ellipsoid(size: tuple[float, float, float], turn: tuple[float, float, float, float]) -> np.ndarray:
    """Radial distance of an ellipsoid with full extents `size`, turned by a quaternion."""
    row = empty_rows(1)
    row[0, ROTATION : ROTATION + 4] = np.array(turn) / np.linalg.norm(turn)
    row[0, SHAPES : SHAPES + 5] = (*size, 1.0, 1.0)
    return field_of(row, wp.get_device("cpu"))


def field_of(rows: np.ndarray, device: wp.Device) -> np.ndarray:
    """The hard union of superquadrics on the grid."""
    shape, lower, spacing = cell_centres(RESOLUTION)
    return evaluate_grid(PrimitiveSet(rows, [FAMILY] * len(rows), device), shape, lower, spacing)


def iou(rows: np.ndarray, grid: np.ndarray, device: wp.Device) -> float:
    """Of the superquadrics and a solid."""
    a, b = field_of(rows, device) < 0.0, grid < 0.0
    return np.count_nonzero(a & b) / np.count_nonzero(a | b)


SOLIDS = {
    "box": (lambda: box((0.7, 0.4, 0.3)), 0.95, 1),
    "ellipsoid": (lambda: ellipsoid((1.4, 0.9, 0.6), (0.9, 0.2, -0.3, 0.1)), 0.96, 1),
    "two balls": (lambda: np.minimum(ball(0.35, (-0.5, 0, 0)), ball(0.25, (0.5, 0.2, 0.1))), 0.94, 2),
    "dumbbell": (
        lambda: np.minimum.reduce(
            [ball(0.32, (-0.55, 0, 0)), ball(0.32, (0.55, 0, 0)), box((0.5, 0.12, 0.12))]
        ),
        0.92,
        8,
    ),
}
"""Name: distances, IoU that is reached at least, parts that are needed at most."""


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_found(device: wp.Device, name: str) -> None:
    make, wanted, most = SOLIDS[name]
    grid = make().astype(np.float32)
    rows = march(grid, device)
    # Slivers that the first superquadrics leave at their edges may become parts of their own.
    assert 1 <= len(rows) <= most + 3
    assert iou(rows, grid, device) >= wanted
    assert iou(rows[:most], grid, device) >= wanted - 0.03


def test_same_bytes_every_time(device: wp.Device) -> None:
    grid = SOLIDS["dumbbell"][0]().astype(np.float32)
    first, second = march(grid, device, seed=3), march(grid, device, seed=3)
    assert first.tobytes() == second.tobytes()


def test_nothing_inside_gives_no_part(device: wp.Device) -> None:
    assert march(np.full((32, 32, 32), 0.5, np.float32), device).shape == (0, empty_rows(0).shape[1])


def test_smallest_region_is_respected(device: wp.Device) -> None:
    speck = ball(2.0 / RESOLUTION, (0.0, 0.0, 0.0)).astype(np.float32)
    assert len(march(speck, device, MarchingConfig(smallest=1000))) == 0


def test_regions_are_the_connected_parts_below_a_level() -> None:
    depth = np.zeros((10, 10, 10), np.float32)
    depth[1:4, 1:4, 1:4] = 2.0
    depth[6:9, 6:8, 6:8] = 3.0
    depth[5, 5, 5] = 1.0
    regions = regions_below(depth, 1.5, smallest=2, most=5)
    assert [region.volume for region in regions] == [27, 12]
    assert [region.lower.tolist() for region in regions] == [[1, 1, 1], [6, 6, 6]]
    assert len(regions_below(depth, 0.5, smallest=1, most=5)) == 3
    assert regions_below(depth, 4.0, smallest=1, most=5) == []


def test_candidates_lie_where_their_region_is() -> None:
    depth = np.zeros((64, 64, 64), np.float32)
    depth[20:40, 30:34, 30:34] = 1.0
    region = regions_below(depth, 1.0, smallest=1, most=1)[0]
    rows = region_candidates(region, 64)
    np.testing.assert_allclose(rows[0, :3], [-1 / 16, 0, 0], atol=1e-6)
    np.testing.assert_allclose(rows[0, SHAPES : SHAPES + 3] * 32, [22, 6, 6], rtol=1e-5)
    # Every turn has the extents of the same box along its own axes.
    assert {tuple(np.round(np.sort(row[SHAPES : SHAPES + 3] * 32)).tolist()) for row in rows[:6]} == {
        (6, 6, 22)
    }


def test_readme_grid_is_a_cell_too_thick_and_half_a_cell_off() -> None:
    fine = (np.linalg.norm(centres(64), axis=-1) - 0.5).astype(np.float32)
    coarse = readme_grid(fine)
    corner = np.arange(32) * (2.0 / 32) - 1.0
    expected = np.linalg.norm(np.stack(np.meshgrid(corner, corner, corner, indexing="ij"), -1), axis=-1) - 0.5
    # In the first layer the fine grid does not reach as far; at the ball's centre the distance has a kink.
    smooth = (expected > -0.4) & (np.indices(expected.shape).min(axis=0) > 0)
    np.testing.assert_allclose(coarse[smooth], expected[smooth] - 2.0 / 32, atol=3e-3)
