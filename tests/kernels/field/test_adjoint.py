"""Gradients through `wp.Tape` against central differences of float64 references."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from reference import primitive, union
from scenes import random_rows
from scipy.spatial.transform import Rotation

from resfit.fitter.refine.first_order import to_raw
from resfit.kernels.field.adjoint import by_block, by_primitive, differentiable_assembly, differentiable_union
from resfit.kernels.field.evaluate import evaluate_assembly, evaluate_primitives
from resfit.kernels.field.hilbert import curve_codes
from resfit.kernels.field.points import point_blocks
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.field.raw_parameters import activate_rows
from resfit.kernels.primitives import FAMILIES
from resfit.kernels.rows import BLEND, GATE, ROW, SHAPES, empty_rows
from resfit.kernels.runtime import launch as launching

MIXED = ["superfrustum", "cuboid", "superfrustum", "superprimitive", "superquadric", "superfrustum"]


def gradient_of(array: wp.array) -> np.ndarray:
    """What a tape has left of it."""
    assert array.grad is not None
    return array.grad.numpy()


def weights_of(blocks, rng):
    weights = np.zeros(blocks.x.shape[0], np.float32)
    weights[: blocks.count] = rng.normal(size=blocks.count)
    return weights


def tape_gradient(rows, families, points, weights, device):
    """Gradient (primitive_count, ROW) of the weighted sum of the union over the points."""
    primitives = PrimitiveSet(rows, families, device, requires_grad=True)
    blocks = point_blocks(points, device)
    tape = wp.Tape()
    field = differentiable_union(primitives, blocks, tape)
    tape.backward(grads={field: wp.array(weights, dtype=float, device=device)})
    return field.numpy()[: blocks.count], gradient_of(primitives.rows).reshape(-1, ROW)


@pytest.mark.parametrize("blend", [0.0, 0.1])
def test_every_entry_of_a_row(blend, device, rng):
    """Translation, rotation, shape, blend and gate of mixed families, hard and smooth."""
    rows = random_rows(rng, MIXED)
    rows[:, BLEND] = blend * rng.uniform(0.5, 1.5, len(rows))
    rows[:, GATE] = rng.uniform(0.85, 1.0, len(rows))
    points = rng.uniform(-0.9, 0.9, (700, 3)).astype(np.float32)
    weights = weights_of(point_blocks(points, device), rng)
    values, found = tape_gradient(rows, MIXED, points, weights, device)
    exact_rows, exact_points = rows.astype(np.float64), points.astype(np.float64)
    np.testing.assert_allclose(values, union(exact_points, exact_rows, MIXED), atol=1e-5)
    step = 1e-6
    for k in range(len(rows)):
        for entry in range(ROW):
            if entry == BLEND and (k == 0 or blend == 0.0):
                continue
            up, down = exact_rows.copy(), exact_rows.copy()
            up[k, entry] += step
            down[k, entry] -= step
            difference = (union(exact_points, up, MIXED) - union(exact_points, down, MIXED)) / (2 * step)
            expected = float(weights[: len(points)] @ difference)
            # Creases that a single point sits on move a sum by at most that point's weight.
            assert found[k, entry] == pytest.approx(expected, rel=5e-3, abs=0.05), (k, entry)


def test_first_blend_has_no_gradient(device, rng):
    families = ["superfrustum"] * 3
    rows = random_rows(rng, families)
    points = rng.uniform(-1, 1, (100, 3))
    weights = weights_of(point_blocks(points, device), rng)
    _, found = tape_gradient(rows, families, points, weights, device)
    assert found[0, BLEND] == 0.0


def test_gradients_accumulate_and_chain(device, rng):
    """Two uses on one tape add up, and a Warp kernel can follow the union."""
    families = ["superfrustum", "cuboid"]
    rows = random_rows(rng, families)
    points = rng.uniform(-1, 1, (128, 3))
    weights = np.ones(128, np.float32)
    _, once = tape_gradient(rows, families, points, weights, device)
    primitives = PrimitiveSet(rows, families, device, requires_grad=True)
    blocks = point_blocks(points, device)
    tape = wp.Tape()
    fields = [differentiable_union(primitives, blocks, tape) for _ in range(2)]
    tape.backward(grads={field: wp.array(weights, dtype=float, device=device) for field in fields})
    np.testing.assert_allclose(gradient_of(primitives.rows).reshape(-1, ROW), 2 * once, rtol=1e-5, atol=1e-5)


def test_far_from_any_crease_one_step_descends(device, rng):
    """A small step against the gradient of the squared field lowers it: sign and scale are right together."""
    families = ["superfrustum"] * 4
    rows = random_rows(rng, families)
    points = rng.uniform(-0.9, 0.9, (2048, 3)).astype(np.float32)
    field = evaluate_assembly(PrimitiveSet(rows, families, device), points)
    _, gradient = tape_gradient(rows, families, points, (2 * field / len(points)).astype(np.float32), device)
    stepped = rows - 1e-3 * gradient / np.linalg.norm(gradient)
    after = evaluate_assembly(PrimitiveSet(stepped, families, device), points)
    decrease = np.mean(field**2) - np.mean(after**2)
    assert decrease == pytest.approx(1e-3 * np.linalg.norm(gradient), rel=0.1)


def test_distances_of_single_primitives(device, rng):
    """Block by block, with padding and runs of several families."""
    rows = random_rows(rng, MIXED)
    points = rng.uniform(-1, 1, (150, 3)).astype(np.float32)
    primitives = PrimitiveSet(rows, MIXED, device, requires_grad=True)
    field, values = differentiable_assembly(primitives, point_blocks(points, device), wp.Tape())
    found = by_primitive(values, len(rows), 150)
    np.testing.assert_allclose(found, evaluate_primitives(primitives, points), atol=1e-6)
    np.testing.assert_allclose(field.numpy()[:150], evaluate_assembly(primitives, points), atol=1e-6)
    np.testing.assert_array_equal(by_primitive(wp.array(by_block(found), dtype=float), len(rows), 150), found)


@pytest.mark.parametrize("blend", [0.0, 0.05])
def test_leaving_primitives_out_changes_nothing(blend, device, rng):
    """Points that lie together need few primitives a block, an assembly's step lists all: the same gradient."""
    families = ["superfrustum"] * 10 + ["cuboid"] * 10 + ["superfrustum"] * 10
    rows = random_rows(rng, families)
    rows[:, BLEND] = blend
    points = rng.uniform(-1, 1, (5000, 3)).astype(np.float32)
    weights = weights_of(point_blocks(points, device), rng)
    order = np.argsort(curve_codes(points), kind="stable")
    ordered = np.zeros_like(weights)
    ordered[:5000] = weights[order]
    _, scattered = tape_gradient(rows, families, points, weights, device)
    _, together = tape_gradient(rows, families, points[order], ordered, device)
    primitives = PrimitiveSet(rows, families, device, requires_grad=True)
    tape = wp.Tape()
    field, _ = differentiable_assembly(primitives, point_blocks(points[order], device), tape)
    tape.backward(grads={field: wp.array(ordered, dtype=float, device=device)})
    every = gradient_of(primitives.rows).reshape(-1, ROW)
    scale = np.abs(every).max()
    np.testing.assert_allclose(together, every, atol=1e-5 * scale)
    np.testing.assert_allclose(scattered, every, atol=1e-5 * scale)


def test_points_without_weight_ask_for_nothing(device, rng):
    """Whole blocks of them, and all of them: exactly no gradient; a weight that is no number is not lost."""
    rows = random_rows(rng, MIXED)
    points = rng.uniform(-0.9, 0.9, (256, 3)).astype(np.float32)
    weights = np.zeros(256, np.float32)
    _, none = tape_gradient(rows, MIXED, points, weights, device)
    assert not none.any()
    weights[64:128] = rng.normal(size=64)
    _, some = tape_gradient(rows, MIXED, points, weights, device)
    _, alone = tape_gradient(rows, MIXED, points[64:128], weights[64:128], device)
    assert some.any()
    np.testing.assert_array_equal(some, alone)
    weights[:] = np.nan
    assert np.isnan(tape_gradient(rows, MIXED, points, weights, device)[1]).any()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
@pytest.mark.parametrize("blend", [0.5, 0.5 + 1 / 64])
def test_a_block_at_the_edge_of_the_blend(order, blend, device):
    """Two boxes whose distances differ by 1/2 at all points: with that blend the farther one has exactly no part."""
    rows = empty_rows(2)
    rows[:, SHAPES : SHAPES + 3] = 1.0
    rows[1, 2] = -0.5
    rows[:, BLEND] = blend
    points = np.zeros((64, 3), np.float32)
    points[:, 0], points[:, 2] = np.linspace(-0.25, 0.25, 64), 0.75
    weights = np.ones(64, np.float32)
    field, found = tape_gradient(rows[list(order)], ["cuboid"] * 2, points, weights, device)
    near, far = found[order.index(0)], found[order.index(1)]
    share = 0.5 - 0.5 / (2 * blend)
    np.testing.assert_allclose(field, 0.25 - (blend - 0.5) ** 2 / (4 * blend), atol=1e-6)
    np.testing.assert_allclose([near[2], far[2]], [-64 * (1 - share), -64 * share], rtol=1e-4)
    assert found[1, BLEND] == pytest.approx(-64 * share * (1 - share), rel=1e-4)
    assert far.any() == (blend > 0.5)


def test_empty_cases(device, rng):
    primitives = PrimitiveSet(random_rows(rng, ["cuboid"]), ["cuboid"], device, requires_grad=True)
    tape = wp.Tape()
    assert differentiable_union(primitives, point_blocks(np.zeros((0, 3)), device), tape).shape == (1,)
    nothing = PrimitiveSet(np.zeros((0, ROW)), [], device, requires_grad=True)
    field = differentiable_union(nothing, point_blocks(np.zeros((5, 3)), device), tape)
    assert field.numpy().min() > 1e20


def test_same_bits_on_one_core_and_two(device, rng, monkeypatch):
    if not device.is_cpu:
        pytest.skip("GPU launches are not split")
    families = ["superfrustum"] * 16
    rows = random_rows(rng, families)
    points = rng.uniform(-1, 1, (20_000, 3))
    weights = weights_of(point_blocks(points, device), rng)
    results = []
    for cores in (1, 2):
        monkeypatch.setattr(launching, "core_count", lambda cores=cores: cores)
        results.append(tape_gradient(rows, families, points, weights, device)[1].tobytes())
    assert results[0] == results[1]


def test_gradients_of_single_primitives_and_activation(device, rng):
    """A loss on the union and on gated distances, through the raw numbers, against float64 differences."""
    families = ["superfrustum", "cuboid", "superfrustum"]
    rows = random_rows(rng, families)
    raw = to_raw(rows, families).astype(np.float64)
    points = rng.uniform(-0.9, 0.9, (500, 3)).astype(np.float32)
    bounds = [FAMILIES[name].fit_range for name in families]
    noise = rng.gumbel(size=(3, 2))
    on_field, on_values = rng.normal(size=500), rng.normal(size=(3, 500))

    def activated(numbers):
        out = np.zeros((3, ROW))
        out[:, :3] = numbers[:, :3]
        out[:, 3:7] = Rotation.from_rotvec(numbers[:, 3:6]).as_quat()[:, [3, 0, 1, 2]]
        for k, (low, high) in enumerate(bounds):
            out[k, 7:15] = low + (high - low) / (1 + np.exp(-numbers[k, 6:14]))
        out[:, BLEND] = np.log1p(np.exp(numbers[:, 14]))
        lead = numbers[:, 15] + noise[:, 0] - numbers[:, 16] - noise[:, 1]
        out[:, GATE] = 1 / (1 + np.exp(-lead / 0.7))
        return out

    def loss(numbers):
        out = activated(numbers)
        gated = [
            row[GATE] * primitive(points, row, name) + 1 - row[GATE]
            for row, name in zip(out, families, strict=True)
        ]
        return on_field @ union(points, out, families) + (on_values * np.array(gated)).sum()

    primitives = PrimitiveSet(rows, families, device, requires_grad=True)
    variable = wp.array(raw.ravel().astype(np.float32), dtype=float, device=device, requires_grad=True)
    low, high = (
        wp.array(np.stack([pair[i] for pair in bounds]).ravel(), dtype=float, device=device) for i in (0, 1)
    )
    tape = wp.Tape()
    activate_rows(variable, low, high, noise, 0.7, primitives, tape)
    np.testing.assert_allclose(primitives.rows_numpy(), activated(raw), atol=1e-5)
    blocks = point_blocks(points, device)
    field, values = differentiable_assembly(primitives, blocks, tape)
    grads = {
        field: wp.array(by_block(on_field[None]), dtype=float, device=device),
        values: wp.array(by_block(on_values), dtype=float, device=device),
    }
    tape.backward(grads=grads)
    found = gradient_of(variable).reshape(3, ROW)
    for k in range(3):
        for entry in range(ROW):
            step = np.zeros((3, ROW))
            step[k, entry] = 1e-6
            expected = (loss(raw + step) - loss(raw - step)) / 2e-6
            assert found[k, entry] == pytest.approx(expected, rel=5e-3, abs=0.05), (k, entry)
