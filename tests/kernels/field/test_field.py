"""The union's field: smooth minimum, culling, mixed families, grids, gradients, edge cases."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from reference import primitive, union
from scenes import random_rows, vectors

from resfit.kernels.field.containment_count import count_containing
from resfit.kernels.field.culling import active_lists, bound_blocks, cull, every_primitive
from resfit.kernels.field.evaluate import (
    cell_centres,
    evaluate_assembly,
    evaluate_grid,
    evaluate_primitives,
    primitives_at,
    union_at,
)
from resfit.kernels.field.gradient import evaluate_gradient
from resfit.kernels.field.points import grid_blocks, point_blocks
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.primitives import FAMILIES
from resfit.kernels.rows import BLEND, GATE, SHAPES, empty_rows
from resfit.kernels.runtime import launch as launching

MIXED = ["superfrustum", "superfrustum", "cuboid", "superquadric", "superprimitive", "superfrustum", "cuboid"]


def cloud(rng, count=3000):
    """Points of [-1, 1]^3 sorted into cells, so that blocks are compact."""
    points = rng.uniform(-1, 1, (count, 3)).astype(np.float32)
    return points[np.lexsort(np.floor(points * 4).T)]


def test_smooth_union_vectors(device):
    """Two spheres whose distances are a and b: the test vectors' values within 1e-6."""
    cases = vectors("smooth_union")
    for case in cases:
        if case["k"] < 0:
            continue
        rows = empty_rows(2)
        # At the origin, a sphere of radius R centred there has the distance -R: dilation is legal from 0, so the
        # sphere is moved away by 10 and given the radius 10 - distance.
        for row, value in zip(rows, (case["a"], case["b"]), strict=True):
            row[0] = 10.0
            row[SHAPES + 4] = 10.0 - value
        rows[1, BLEND] = case["k"]
        found = evaluate_assembly(PrimitiveSet(rows, ["superfrustum"] * 2, device), np.zeros((1, 3)))[0]
        assert found == pytest.approx(case["value"], abs=5e-6)


def test_mixed_families_agree_with_float64(device, rng):
    rows = random_rows(rng, MIXED)
    rows[:, GATE] = rng.uniform(0.8, 1.0, len(rows))
    primitives = PrimitiveSet(rows, MIXED, device)
    points = cloud(rng)
    np.testing.assert_allclose(evaluate_assembly(primitives, points), union(points, rows, MIXED), atol=1e-5)
    alone = evaluate_primitives(primitives, points)
    for row, name, values in zip(rows, MIXED, alone, strict=True):
        np.testing.assert_allclose(values, primitive(points, row, name), atol=1e-5)


@pytest.mark.parametrize("blend", [0.0, 0.02, 0.3])
def test_culling_changes_no_bit(blend, device, rng):
    """Culled and dense evaluation agree exactly, and culling does leave primitives out."""
    families = ["superfrustum"] * 20 + ["cuboid", "superquadric"]
    for _ in range(5):
        rows = random_rows(rng, families)
        rows[:, SHAPES : SHAPES + 3] *= 0.4
        rows[:, BLEND] = blend
        primitives = PrimitiveSet(rows, families, device)
        for blocks in (
            point_blocks(cloud(rng, 5000), device),
            grid_blocks((40, 40, 40), (-1, -1, -1), 0.05, device),
        ):
            lists = cull(primitives, blocks)
            culled = union_at(primitives, blocks, lists=lists).numpy()
            dense = union_at(primitives, blocks, lists=every_primitive(primitives, blocks)).numpy()
            np.testing.assert_array_equal(culled, dense)
        if blend < 0.1:
            assert lists.counts.numpy().mean() < 0.6 * len(families)


def test_holders_are_those_that_dense_evaluation_finds(device, rng):
    """Counts agree with every primitive's sign at every point, and blocks deep inside are counted whole."""
    families = ["superfrustum"] * 12 + ["cuboid", "superquadric"]
    rows = random_rows(rng, families)
    rows[0, SHAPES : SHAPES + 3] = 1.5
    primitives = PrimitiveSet(rows, families, device)
    for blocks in (
        point_blocks(cloud(rng, 5000), device),
        grid_blocks((40, 40, 40), (-1, -1, -1), 0.05, device),
    ):
        values = primitives_at(primitives, blocks).numpy().reshape(len(rows), -1)
        found = count_containing(primitives, blocks, bound_blocks(blocks)).numpy()
        np.testing.assert_array_equal(found, (values < 0).sum(axis=0))
        assert found.max() > 1 and found.min() == 0


def test_reach_bounds_the_field(device, rng):
    """Within a block the field never leaves [f(c) - reach, f(c) + reach], bent and tapered primitives included."""
    from resfit.kernels.field.culling import bound_blocks, bound_primitives
    from resfit.kernels.field.points import padded_count

    for name in FAMILIES:
        families = [name] * 60
        rows = random_rows(rng, families)
        primitives = PrimitiveSet(rows, families, device)
        centre = rng.uniform(-1, 1, (100, 1, 3))
        points = (centre + rng.uniform(-1, 1, (100, 64, 3)) * rng.uniform(0.01, 0.3, (100, 1, 1))).reshape(
            -1, 3
        )
        blocks = point_blocks(points, device)
        bounds = bound_blocks(blocks)
        size = padded_count(blocks.block_count)
        middle, reach = (wp.zeros(60 * size, dtype=float, device=device) for _ in range(2))
        bound_primitives(primitives, bounds, (middle, reach))
        values = evaluate_primitives(primitives, points).reshape(60, 100, 64)
        at = middle.numpy().reshape(60, size)[:, :100, None]
        spread = reach.numpy().reshape(60, size)[:, :100, None]
        assert (np.abs(values - at) <= spread + 1e-5).all(), name


def test_grid_equals_points(device, rng):
    families = ["superfrustum"] * 5
    primitives = PrimitiveSet(random_rows(rng, families), families, device)
    for shape in ((8, 8, 8), (5, 9, 13), (1, 1, 1)):
        grid = evaluate_grid(primitives, shape, (-0.9, -0.8, -0.7), 0.11)
        index = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1).reshape(-1, 3)
        points = np.array([-0.9, -0.8, -0.7]) + 0.11 * index
        np.testing.assert_allclose(grid.ravel(), evaluate_assembly(primitives, points), atol=2e-6)
    shape, lower, spacing = cell_centres(4)
    assert shape == (4, 4, 4) and lower == (-0.75,) * 3 and spacing == 0.5


def test_gradient_agrees_with_differences(device, rng):
    rows = random_rows(rng, MIXED)
    primitives = PrimitiveSet(rows, MIXED, device)
    points = cloud(rng, 2000)
    values, gradients = evaluate_gradient(primitives, points)
    np.testing.assert_allclose(values, evaluate_assembly(primitives, points), atol=2e-6)
    step = 1e-6 * np.eye(3)
    exact = points.astype(np.float64)
    expected = np.stack(
        [(union(exact + d, rows, MIXED) - union(exact - d, rows, MIXED)) / 2e-6 for d in step], 1
    )
    assert (np.abs(gradients - expected).max(1) < 2e-3).mean() > 0.995


def test_nothing_and_one(device):
    """No primitives, no points, one of each."""
    empty = PrimitiveSet(empty_rows(0), [], device)
    assert evaluate_assembly(empty, np.zeros((3, 3))).min() > 1e20
    assert evaluate_primitives(empty, np.zeros((3, 3))).shape == (0, 3)
    assert evaluate_grid(empty, (3, 3, 3), (0, 0, 0), 0.1).min() > 1e20
    rows = empty_rows(1)
    rows[0, SHAPES : SHAPES + 3] = 0.5
    single = PrimitiveSet(rows, ["cuboid"], device)
    assert evaluate_assembly(single, np.zeros((0, 3))).shape == (0,)
    assert evaluate_primitives(single, np.zeros((0, 3))).shape == (1, 0)
    assert evaluate_assembly(single, np.zeros((1, 3)))[0] == pytest.approx(-0.25)
    values, gradients = evaluate_gradient(single, np.zeros((0, 3)))
    assert values.shape == (0,) and gradients.shape == (0, 3)
    assert active_lists(single, point_blocks(np.zeros((1, 3)), device)).counts.numpy()[0] == 1


def test_rows_and_families_must_match(device):
    with pytest.raises(ValueError, match="2 rows but 1 families"):
        PrimitiveSet(empty_rows(2), ["cuboid"], device)


def test_same_bits_on_one_core_and_two(device, rng, monkeypatch):
    """A launch split over threads writes the very same bytes."""
    if not device.is_cpu:
        pytest.skip("GPU launches are not split")
    families = ["superfrustum"] * 24
    rows = random_rows(rng, families)
    points = cloud(rng, 50_000)
    results = []
    for cores in (1, 2, 3):
        monkeypatch.setattr(launching, "core_count", lambda cores=cores: cores)
        primitives = PrimitiveSet(rows, families, device)
        results.append(
            (
                evaluate_assembly(primitives, points).tobytes(),
                evaluate_primitives(primitives, points).tobytes(),
                evaluate_gradient(primitives, points)[1].tobytes(),
            )
        )
    assert results[0] == results[1] == results[2]
