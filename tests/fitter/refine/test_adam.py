"""The paper's optimiser: folds undone by hand, copies swept along other axes, and an axis learned."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenes import random_rows

from resfit.fitter.objective.samples import objective_samples
from resfit.fitter.presets import AdamConfig
from resfit.fitter.refine.adam import refine_with_adam
from resfit.fitter.refine.adam_loss import fold_prefixes, unfold
from resfit.fitter.refine.sweep_axis import SweepAxes, turned_copies
from resfit.kernels.field.combine import fold
from resfit.kernels.field.evaluate import evaluate_grid, evaluate_primitives
from resfit.kernels.field.points import point_blocks
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.primitives import family
from resfit.kernels.rows import BLEND, GATE, ROTATION, ROW, SHAPE, SHAPES, empty_rows
from resfit.shape.target import make_target

FAMILIES = ["superfrustum", "superprimitive", "superfrustum"]


def test_unfold_is_the_derivative_of_the_fold(rng):
    gated, blends = rng.normal(size=(4, 50)) * 0.1, np.array([0.0, 0.05, 0.0, 0.1])
    weight = rng.normal(size=50)
    prefixes = fold_prefixes(gated, blends)
    np.testing.assert_allclose(prefixes[-1], fold(gated, blends), atol=1e-12)
    passed, blend_grad = unfold(prefixes, gated, blends, weight)
    for k in range(4):
        step = np.zeros_like(gated)
        step[k] = 1e-7
        rise = fold_prefixes(gated + step, blends)[-1] - fold_prefixes(gated - step, blends)[-1]
        np.testing.assert_allclose(passed[k], weight * rise / 2e-7, atol=1e-5)
    for k in (1, 3):
        step = np.eye(4)[k] * 1e-7
        rise = fold_prefixes(gated, blends + step)[-1] - fold_prefixes(gated, blends - step)[-1]
        assert blend_grad[k] == pytest.approx((weight * rise).sum() / 2e-7, abs=1e-5)


def test_turned_copies_have_the_same_box(device, rng):
    """With sharp corners and no taper all three are one box."""
    rows = random_rows(rng, ["superprimitive"] * 3)
    for row in rows:
        size = row[SHAPES : SHAPES + 3].copy()
        row[SHAPES : SHAPES + SHAPE] = family("superprimitive").shape_row(size=size)
    copies = turned_copies(rows)
    points = rng.uniform(-1, 1, (200, 3)).astype(np.float32)
    values = [
        evaluate_primitives(PrimitiveSet(copies[:, turn], ["superprimitive"] * 3, device), points)
        for turn in range(3)
    ]
    for turn in (1, 2):
        np.testing.assert_allclose(np.sign(values[turn]), np.sign(values[0]))
        assert np.abs(copies[:, turn, ROTATION : ROTATION + 4] - rows[:, ROTATION : ROTATION + 4]).max() > 0.1


def test_gradients_of_mixtures_are_those_of_finite_differences(device, rng):
    """Of the reconstruction alone: the quality term's steps have no slope."""
    rows = random_rows(rng, FAMILIES).astype(np.float64)
    rows[:, BLEND], rows[:, GATE] = (0.0, 0.05, 0.1), (1.0, 0.9, 1.0)
    target = make_target(trimesh.creation.box((1.0, 0.7, 0.5)), device, 32, 400)
    samples, config, beta = objective_samples(target), AdamConfig(quality_weight=0.0), 4.0
    batch = np.arange(len(samples.points))
    blocks = point_blocks(samples.points, device)
    axes = SweepAxes(FAMILIES, device)
    axes.logits[:] = rng.normal(size=(3, 3))
    noise = rng.gumbel(size=(3, 3))

    def loss(at: np.ndarray, logits: np.ndarray) -> float:
        weights = np.exp((logits + noise) / 0.8)
        weights /= weights.sum(1, keepdims=True)
        copies = turned_copies(at).reshape(-1, ROW).astype(np.float32)
        names = [name for name in FAMILIES for _ in range(3)]
        swept = evaluate_primitives(PrimitiveSet(copies, names, device), samples.points).astype(np.float64)
        mixed = np.einsum("ki,kin->kn", weights, swept.reshape(3, 3, -1))
        gated = at[:, GATE, None] * mixed + 1.0 - at[:, GATE, None]
        union = fold(gated, at[:, BLEND])
        mask = (union < 0.1) | (samples.distance < 0.1)
        error = 1 / (1 + np.exp(beta * union)) - 1 / (1 + np.exp(beta * samples.distance))
        return float((mask * samples.weight * error**2).sum() / mask.sum())

    rows_grad, logits_grad = axes.gradients(
        rows.astype(np.float32), noise, 0.8, blocks, samples, batch, beta, config
    )
    whole, scale = loss(rows, axes.logits), np.abs(rows_grad).max()
    assert whole > 0
    for k in range(3):
        for column in (0, 1, 2, SHAPES, SHAPES + 1, SHAPES + 2, GATE):
            step = np.zeros_like(rows)
            step[k, column] = 2e-3
            slope = (loss(rows + step, axes.logits) - loss(rows - step, axes.logits)) / 4e-3
            assert rows_grad[k, column] == pytest.approx(slope, abs=0.05 * scale)
        for axis in range(3):
            step = np.zeros((3, 3))
            step[k, axis] = 1e-2
            slope = (loss(rows, axes.logits + step) - loss(rows, axes.logits - step)) / 2e-2
            assert logits_grad[k, axis] == pytest.approx(slope, abs=0.05 * np.abs(logits_grad).max())


def wrong_seed() -> np.ndarray:
    """A seed of the cylinder below, swept along its diameter."""
    row = empty_rows(1)
    half = np.sqrt(0.5)
    # Local z along the world's x.
    row[0, ROTATION : ROTATION + 4] = (half, 0.0, half, 0.0)
    row[0, SHAPES : SHAPES + SHAPE] = family("superfrustum").shape_row(size=(0.9, 0.5, 0.5), roundness=0.5)
    return row


def test_a_cylinder_seeded_with_the_wrong_axis_ends_with_the_right_one(device):
    target = make_target(trimesh.creation.cylinder(0.25, 0.9, sections=64), device)
    samples = objective_samples(target)
    found = {}
    for axis in ("fixed", "learned"):
        config = AdamConfig(axis=axis)
        seed = wrong_seed()
        seed[:, SHAPES : SHAPES + 3] *= 2.0
        rows = refine_with_adam(seed, ["superfrustum"], samples, config, 0, device)
        held = evaluate_grid(
            PrimitiveSet(rows, ["superfrustum"], device), (128, 128, 128), (-1 + 1 / 128,) * 3, 2 / 128
        )
        inside = target.grid < 0
        iou = ((held < 0) & inside).sum() / ((held < 0) | inside).sum()
        x, y = rows[0, ROTATION + 1 : ROTATION + 3]
        found[axis] = (float(iou), abs(1 - 2 * (x * x + y * y)))
    assert found["learned"][0] > 0.97 and found["learned"][1] > 0.99, "swept along the cylinder's axis"
    assert found["learned"][0] > found["fixed"][0] + 0.02
    assert found["fixed"][1] < 0.1
