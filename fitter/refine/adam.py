"""The paper's optimiser: Adam on its losses, with stochastic existence (paper, "Decomposition-Aware Optimization").

Reconstruction: weighted squared error of the occupancies within the mask. Parsimony: the expected number of
primitives. Quality: space that two primitives hold, and space that only the blends hold. Existence is a Gumbel
softmax; its noise and temperature fall as the occupancy sharpens. The sweep axis may be learned the same way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from ...kernels.field.adjoint import by_block, by_primitive, differentiable_assembly
from ...kernels.field.gradient import evaluate_gradient
from ...kernels.field.points import PointBlocks, point_blocks
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.field.raw_parameters import RAW_DROP, RAW_KEEP
from ...kernels.primitives import family
from ...kernels.rows import GATE, ROW
from ..objective.objective import ObjectiveSamples
from ..presets import AdamConfig
from .adam_loss import loss_gradients
from .first_order import Moments, Unbounded, to_raw
from .sweep_axis import SweepAxes


def refine_with_adam(
    rows: np.ndarray,
    families: Sequence[str],
    samples: ObjectiveSamples,
    config: AdamConfig,
    seed: int,
    device: wp.Device,
    should_stop: Callable[[], bool] = lambda: False,
    measure: Callable[[np.ndarray], np.ndarray] | None = None,
) -> np.ndarray:
    """Move all primitives by Adam and drop those that no longer exist.

    Args:
        rows: (primitive_count, ROW).
        families: their families.
        samples: target distances at the points of the loss.
        config: steps, rates, weights.
        seed: of minibatches and existence noise.
        device: where to evaluate.
        should_stop: asked before each step.
        measure: signed distance of the target at points (n, 3), which noisy and predicted points need.

    Returns:
        (kept, ROW) float32, gates 1; at least the primitive that is surest to exist.
    """
    if not len(rows):
        return rows
    rng = np.random.default_rng(seed)
    unbounded = Unbounded(rows, families, device)
    moments = Moments(unbounded.raw.shape)
    learned = config.axis == "learned" and all(family(name).has("size") for name in families)
    axes = SweepAxes(families, device) if learned else None
    axis_moments = Moments((len(rows), 3))
    learned_steps = round(config.axis_share * config.steps)
    pool = samples
    for step in range(config.steps):
        if should_stop():
            break
        if axes and step == learned_steps:
            _bake(unbounded, axes)
            axes, moments = None, Moments(unbounded.raw.shape)
        moment = _Moment.of(step, config, rng, len(rows))
        if measure and (config.noise or config.predicted) and step % config.resample == 0:
            pool = redraw(samples, unbounded.primitives, config, moment.progress, measure, rng)
        batch = rng.choice(len(pool.points), min(config.batch, len(pool.points)), replace=False)
        blocks = point_blocks(pool.points[batch], device)
        tape = wp.Tape()
        unbounded.activate(tape, moment.noise, moment.temperature)
        if axes:
            share = 1.0 - step / max(1, learned_steps)
            noise = share * rng.gumbel(size=(len(rows), 3))
            rows_grad, axes_grad = axes.gradients(
                unbounded.primitives.rows_numpy(),
                noise,
                moment.temperature,
                blocks,
                pool,
                batch,
                moment.beta,
                config,
            )
            _backward_rows(unbounded, tape, rows_grad, config)
            axes.logits += axis_moments.step(axes_grad, moment.rate)
        else:
            _backward(unbounded, tape, blocks, pool, batch, moment.beta, config)
        unbounded.raw += moments.step(unbounded.gradient(tape), moment.rate).astype(np.float32)
    if axes:
        _bake(unbounded, axes)
    final = unbounded.rows()
    kept = final[:, GATE] > 0.5
    if not kept.any():
        kept[np.argmax(final[:, GATE])] = True
    final[:, GATE] = 1.0
    return final[kept]


@dataclass(frozen=True)
class _Moment:
    """Schedule values and noise of a step."""

    progress: float
    beta: float
    temperature: float
    rate: float
    noise: np.ndarray
    """(primitive_count, 2), of the existence logits."""

    @classmethod
    def of(cls, step: int, config: AdamConfig, rng: np.random.Generator, count: int) -> _Moment:
        progress = step / max(1, config.steps - 1)
        return cls(
            progress,
            config.betas[0] * (config.betas[1] / config.betas[0]) ** progress,
            config.temperatures[0] + (config.temperatures[1] - config.temperatures[0]) * progress,
            config.rate * (0.5 + 0.5 * np.cos(np.pi * progress)),
            rng.gumbel(size=(count, 2)) * (1.0 - progress),
        )


def _bake(unbounded: Unbounded, axes: SweepAxes) -> None:
    """Make the likeliest sweep axis of each primitive its own; existence stays as it is."""
    logits = unbounded.raw[:, [RAW_KEEP, RAW_DROP]]
    unbounded.raw = to_raw(axes.baked(unbounded.rows()), unbounded.families)
    unbounded.raw[:, [RAW_KEEP, RAW_DROP]] = logits


def redraw(
    samples: ObjectiveSamples,
    primitives: PrimitiveSet,
    config: AdamConfig,
    progress: float,
    measure: Callable[[np.ndarray], np.ndarray],
    rng: np.random.Generator,
) -> ObjectiveSamples:
    """Samples shaken by noise that shrinks with progress, some of them moved onto the predicted surface.

    Args:
        samples: as drawn for the target.
        primitives: the prediction.
        config: noise and share of predicted points.
        progress: share of the steps done.
        measure: signed distance of the target at points (n, 3).
        rng: for the draw.

    Returns:
        As many points with their exact distances; weights go with the points.
    """
    points = samples.points.astype(np.float32).copy()
    moved = rng.uniform(size=len(points)) < config.predicted
    if moved.any():
        field, gradient = evaluate_gradient(primitives, points[moved])
        steep = np.maximum((gradient**2).sum(1), 1e-6)
        points[moved] -= np.clip(field / steep, -2.0, 2.0)[:, None] * gradient
    spread = config.noise * (1.0 - progress)
    points += spread * rng.normal(size=points.shape).astype(np.float32)
    return ObjectiveSamples(points, measure(points).astype(np.float32), samples.weight, samples.near_count)


def _backward(
    unbounded: Unbounded,
    tape: wp.Tape,
    blocks: PointBlocks,
    samples: ObjectiveSamples,
    batch: np.ndarray,
    beta: float,
    config: AdamConfig,
) -> None:
    """Take the loss on a batch of the samples, whose points are `blocks`, back to the raw numbers on the tape."""
    primitives = unbounded.primitives
    field, values = differentiable_assembly(primitives, blocks, tape)
    field_grad, values_grad = loss_gradients(
        field.numpy()[: blocks.count],
        by_primitive(values, len(primitives), blocks.count),
        primitives.gates,
        samples.distance[batch],
        samples.weight[batch],
        beta,
        config,
    )
    rows_grad = np.zeros((len(primitives), ROW), np.float32)
    rows_grad[:, GATE] = config.count_weight
    assert primitives.rows.grad is not None
    primitives.rows.grad.assign(rows_grad.ravel())

    grads = {
        of: wp.array(by_block(grad), dtype=float, device=primitives.device)
        for of, grad in ((field, field_grad[None]), (values, values_grad))
    }
    tape.backward(grads=grads)


def _backward_rows(unbounded: Unbounded, tape: wp.Tape, rows_grad: np.ndarray, config: AdamConfig) -> None:
    """Take a gradient to the rows (primitive_count, ROW), and the parsimony, back to the raw numbers on the tape."""
    rows = unbounded.primitives.rows
    rows_grad[:, GATE] += config.count_weight
    given = wp.array(rows_grad.ravel().astype(np.float32), dtype=float, device=rows.device)
    tape.backward(grads={rows: given})
