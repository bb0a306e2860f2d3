"""The paper's optimiser: Adam on its losses, with stochastic existence (paper, "Decomposition-Aware Optimization").

Reconstruction: weighted squared error of the occupancies within the mask. Parsimony: the expected number of
primitives. Quality: space that two primitives hold, and space that only the blends hold. Existence is a Gumbel
softmax; its noise and temperature fall as the occupancy sharpens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation

from ..kernels.activation import RAW_BLEND, RAW_DROP, RAW_KEEP, RAW_SHAPE, RAW_TURN, activate_rows
from ..kernels.adjoint import differentiable_assembly
from ..kernels.gradient import evaluate_gradient
from ..kernels.points import point_blocks
from ..kernels.primitive_set import PrimitiveSet
from ..kernels.primitives import family
from ..kernels.rows import BLEND, GATE, ROTATION, ROW, SHAPE, SHAPES
from .config import AdamConfig
from .objective import ObjectiveSamples
from .refine import MASK

DECAY = (0.9, 0.99)
EPSILON = 1e-8


def to_raw(rows: np.ndarray, families: Sequence[str]) -> np.ndarray:
    """Raw numbers (primitive_count, ROW) whose activation is `rows`; gates become confident logits."""
    raw = np.zeros((len(rows), ROW))
    raw[:, :3] = rows[:, :3]
    turns = rows[:, ROTATION : ROTATION + 4][:, [1, 2, 3, 0]]
    raw[:, RAW_TURN : RAW_TURN + 3] = Rotation.from_quat(turns).as_rotvec()
    for k, name in enumerate(families):
        raw[k, RAW_SHAPE : RAW_SHAPE + SHAPE] = family(name).to_raw(rows[k, SHAPES : SHAPES + SHAPE])
    raw[:, RAW_BLEND] = np.log(np.expm1(np.maximum(rows[:, BLEND], 1e-3)))
    raw[:, RAW_KEEP] = 1.0
    raw[:, RAW_DROP] = -1.0
    return raw.astype(np.float32)


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
    primitives = PrimitiveSet(rows, families, device, requires_grad=True)
    bounds = [family(name).fit_range for name in families]
    low, high = (
        wp.array(np.stack([pair[side] for pair in bounds]).ravel(), dtype=float, device=device)
        for side in range(2)
    )
    raw = to_raw(rows, families)
    variable = wp.array(raw.ravel(), dtype=float, device=device, requires_grad=True)
    momentum, energy = np.zeros_like(raw), np.zeros_like(raw)
    pool = samples
    for step in range(config.steps):
        if should_stop():
            break
        progress = step / max(1, config.steps - 1)
        beta = config.betas[0] * (config.betas[1] / config.betas[0]) ** progress
        temperature = config.temperatures[0] + (config.temperatures[1] - config.temperatures[0]) * progress
        noise = rng.gumbel(size=(len(rows), 2)) * (1.0 - progress)
        if measure and (config.noise or config.predicted) and step % config.resample == 0:
            pool = redraw(samples, primitives, config, progress, measure, rng)
        batch = rng.choice(len(pool.points), min(config.batch, len(pool.points)), replace=False)
        variable.assign(raw.ravel())
        gradient = _gradient(primitives, variable, (low, high), noise, temperature, pool, batch, beta, config)
        momentum = DECAY[0] * momentum + (1 - DECAY[0]) * gradient
        energy = DECAY[1] * energy + (1 - DECAY[1]) * gradient**2
        scale = np.sqrt(energy / (1 - DECAY[1] ** (step + 1))) + EPSILON
        rate = config.rate * (0.5 + 0.5 * np.cos(np.pi * progress))
        raw = (raw - rate * momentum / (1 - DECAY[0] ** (step + 1)) / scale).astype(np.float32)
    variable.assign(raw.ravel())
    activate_rows(variable, low, high, np.zeros((len(rows), 2)), 1.0, primitives, wp.Tape())
    final = primitives.rows_numpy()
    kept = final[:, GATE] > 0.5
    if not kept.any():
        kept[np.argmax(final[:, GATE])] = True
    final[:, GATE] = 1.0
    return final[kept]


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


def _gradient(
    primitives: PrimitiveSet,
    variable: wp.array,
    bounds: tuple[wp.array, wp.array],
    noise: np.ndarray,
    temperature: float,
    samples: ObjectiveSamples,
    batch: np.ndarray,
    beta: float,
    config: AdamConfig,
) -> np.ndarray:
    """Gradient (primitive_count, ROW) of the loss on a batch with respect to the raw numbers."""
    tape = wp.Tape()
    activate_rows(variable, *bounds, noise, temperature, primitives, tape)
    blocks = point_blocks(samples.points[batch], primitives.device)
    field, values = differentiable_assembly(primitives, blocks, tape)
    gates = primitives.gates
    field_grad, values_grad = _loss_gradients(
        field.numpy()[: blocks.count],
        values.numpy().reshape(len(primitives), -1)[:, : blocks.count],
        gates,
        samples.distance[batch],
        samples.weight[batch],
        beta,
        config,
    )
    padding = blocks.x.shape[0] - blocks.count
    rows_grad = np.zeros((len(primitives), ROW), np.float32)
    rows_grad[:, GATE] = config.count_weight
    primitives.rows.grad.assign(rows_grad.ravel())

    def device_array(array: np.ndarray) -> wp.array:
        padded = np.pad(array, [*[(0, 0)] * (array.ndim - 1), (0, padding)])
        return wp.array(padded.ravel().astype(np.float32), dtype=float, device=primitives.device)

    tape.backward(grads={field: device_array(field_grad), values: device_array(values_grad)})
    gradient = variable.grad.numpy().reshape(-1, ROW).copy()
    tape.zero()
    return gradient


def _loss_gradients(
    field: np.ndarray,
    values: np.ndarray,
    gates: np.ndarray,
    distance: np.ndarray,
    weight: np.ndarray,
    beta: float,
    config: AdamConfig,
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the loss to the union (n,) and to each gated distance (primitive_count, n).

    Quality: max(0, sum o_i - 1) is space held twice; max(0, o - min(sum o_i, 1)) is space only the blends hold.
    """

    def occupancy(f: np.ndarray) -> np.ndarray:
        return 1.0 / (1.0 + np.exp(np.clip(beta * f, -40.0, 40.0)))

    mask = (field < MASK) | (distance < MASK)
    count = max(1, int(mask.sum()))
    union = occupancy(field)
    slope = -beta * union * (1 - union)
    field_grad = mask * weight * 2.0 * (union - occupancy(distance)) * slope / count
    each = occupancy(gates[:, None] * values + (1.0 - gates[:, None]))
    total = each.sum(0)
    excess = (total > 1.0).astype(np.float32)
    blended = ((union > np.minimum(total, 1.0)) & (total < 1.0)).astype(np.float32)
    share = config.quality_weight * mask / count
    field_grad += share * (union > np.minimum(total, 1.0)) * slope
    values_grad = share * (excess - blended) * (-beta * each * (1 - each))
    return field_grad, values_grad
