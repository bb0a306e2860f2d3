"""Starting primitives against the solids that they should be near."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from scipy.spatial.transform import Rotation

from resfit.decomposition.region import Region, region_from_mask
from resfit.fitter.propose.initial_primitives import STARTS, all_starts
from resfit.kernels.field.evaluate import evaluate_primitives
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.primitives import FAMILIES
from resfit.kernels.rows import BLEND, GATE, ROTATION, ROW, SHAPES

RESOLUTION = 48
LINE = (np.arange(RESOLUTION) + 0.5) * (2.0 / RESOLUTION) - 1.0
POINTS = np.stack(np.meshgrid(LINE, LINE, LINE, indexing="ij"), axis=-1).reshape(-1, 3)


def solids(p: np.ndarray) -> dict[str, tuple[np.ndarray, float]]:
    """Masks of points (n, 3) in solids, and the IoU that the best start should have."""
    x, y, z = p.T
    r = np.hypot(x, y)
    across = np.maximum(np.abs(x), np.abs(y))
    return {
        "box": ((abs(x) < 0.2) & (abs(y) < 0.3) & (abs(z) < 0.6), 0.85),
        "plate": ((abs(x) < 0.06) & (abs(y) < 0.5) & (abs(z) < 0.6), 0.8),
        "rod": ((r < 0.1) & (abs(z) < 0.7), 0.8),
        "ball": (x * x + y * y + z * z < 0.16, 0.8),
        "capsule": (x * x + y * y + (z - np.clip(z, -0.4, 0.4)) ** 2 < 0.04, 0.75),
        "tube": ((r < 0.45) & (r > 0.3) & (abs(z) < 0.6), 0.6),
        "square tube": ((across < 0.45) & (across > 0.3) & (abs(z) < 0.6), 0.6),
        "torus": (np.hypot(r - 0.5, z) < 0.16, 0.65),
        "cone": ((abs(z) < 0.6) & (r < 0.45 * (0.6 - z) / 1.2), 0.6),
        "frustum": ((abs(z) < 0.5) & (r < 0.3 + 0.2 * z), 0.65),
        "half ring": ((np.hypot(r - 0.5, z) < 0.13) & (x > 0), 0.6),
        "quarter ring": ((np.hypot(r - 0.6, z) < 0.13) & (x > 0) & (y > 0), 0.6),
        "bow": ((np.hypot(np.hypot(x - 1, z) - 1, y) < 0.12) & (abs(z) < 0.6) & (x < 1), 0.6),
    }


def region_of(mask: np.ndarray) -> Region:
    region = region_from_mask(mask.reshape([RESOLUTION] * 3), np.zeros(3), RESOLUTION, "test")
    assert region is not None
    return region


def best_iou(mask: np.ndarray, rows: np.ndarray, family: str, device: wp.Device) -> float:
    inside = evaluate_primitives(PrimitiveSet(rows, [family] * len(rows), device), POINTS) < 0
    return float(((inside & mask).sum(axis=1) / (inside | mask).sum(axis=1)).max())


@pytest.mark.parametrize("turn", [None, 0, 1])
def test_some_start_is_near_every_solid(turn: int | None, device: wp.Device) -> None:
    rotation = np.eye(3) if turn is None else Rotation.random(random_state=turn).as_matrix()
    found = solids(POINTS @ rotation)
    missed = {}
    for name, (mask, wanted) in found.items():
        rows, _, _ = all_starts([region_of(mask)])
        iou = best_iou(mask, rows, "superfrustum", device)
        if iou < wanted:
            missed[name] = (iou, wanted)
    assert missed == {}


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_every_family_has_starts_in_its_range(family: str, device: wp.Device) -> None:
    low, high = FAMILIES[family].fit_range
    for name in ("box", "rod", "torus"):
        mask, _ = solids(POINTS)[name]
        rows, _, kinds = all_starts([region_of(mask)], family)
        assert rows.shape == (len(kinds), ROW) and rows.dtype == np.float32
        assert 1 <= len(kinds) <= STARTS
        shapes = rows[:, SHAPES : SHAPES + len(low)]
        assert (shapes >= low).all() and (shapes <= high).all()
        assert (rows[:, BLEND] == 0).all() and (rows[:, GATE] == 1).all()
        np.testing.assert_allclose(np.linalg.norm(rows[:, ROTATION : ROTATION + 4], axis=1), 1, atol=1e-6)
        if name != "torus":
            assert best_iou(mask, rows, family, device) > 0.7


def test_many_regions_at_once_give_what_each_gives_alone() -> None:
    found = [region_of(mask) for mask, _ in solids(POINTS).values()][:5]
    rows, owner, kinds = all_starts(found)
    for index, region in enumerate(found):
        alone, _, names = all_starts([region])
        np.testing.assert_allclose(rows[owner == index], alone, atol=1e-5)
        assert [kind for kind, of in zip(kinds, owner, strict=True) if of == index] == names


def test_count_limits_starts_and_keeps_the_first() -> None:
    region = region_of(solids(POINTS)["cone"][0])
    rows, _, kinds = all_starts([region])
    few, _, names = all_starts([region], count=7)
    assert len(few) == 7 and names == kinds[:7]
    np.testing.assert_array_equal(few, rows[:7])


def test_kinds_cover_what_a_region_may_be() -> None:
    kinds = {kind for mask, _ in solids(POINTS).values() for kind in all_starts([region_of(mask)])[2]}
    wanted = {"box", "cylinder", "tube", "frame", "ring", "hoop", "cone", "pill", "arc"}
    assert wanted | {"bent -x", "bent +x", "bent -y", "bent +y"} <= kinds


def test_points_without_a_grid_few_points_and_none() -> None:
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * 0.1
    for points in (cube, cube[:2], cube[:1], np.repeat(cube[:1], 9, axis=0)):
        rows, _, kinds = all_starts([points])
        assert len(rows) == len(kinds) > 0
        assert np.isfinite(rows).all()
    rows, _, kinds = all_starts([np.zeros((0, 3))])
    assert rows.shape == (0, ROW) and kinds == []
    rows, owner, kinds = all_starts([np.zeros((0, 3)), cube])
    assert set(owner.tolist()) == {1}
