"""Joint refinement: all primitives follow the union's error together, each by its own damped step.

Points belong to the primitive nearest to them, so the normal matrix is nearly block-diagonal (design: second order
beats Adam). A point that a second primitive covers gives that one a row which pushes it out; where two blend,
both get the union's row. Owners change as primitives move: they are found anew at every step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import warp as wp

from ..kernels.field import primitives_at
from ..kernels.normal_equations import normal_equations
from ..kernels.owned_points import OwnedPoints, owned_points
from ..kernels.ownership import Ownership, find_owners, ownership_arrays
from ..kernels.points import PointBlocks, point_blocks
from ..kernels.primitive_set import PrimitiveSet
from .config import RefineConfig
from .levenberg import apply_steps, fit_ranges, solve_steps
from .objective import ObjectiveSamples

MASK = 0.1
"""Points farther than this from both the target and the assembly, outside, are not in the loss (the paper's mask)."""

EMPTY = 1e30
"""Target distance of a row that wants its primitive elsewhere."""


def fold(values: np.ndarray, blends: np.ndarray) -> np.ndarray:
    """Smooth union (n,) of distances (primitive_count, n), folded left; the first blend is unused."""
    union = values[0]
    for value, blend in zip(values[1:], blends[1:], strict=True):
        lower = np.minimum(union, value)
        if blend > 0:
            near = np.maximum(blend - np.abs(union - value), 0)
            lower = lower - near * near * (0.25 / blend)
        union = lower
    return union


def refine(
    rows: np.ndarray,
    families: Sequence[str],
    samples: ObjectiveSamples,
    config: RefineConfig,
    device: wp.Device,
    should_stop: Callable[[], bool] = lambda: False,
) -> np.ndarray:
    """Move all primitives so that their smooth union matches the target.

    Args:
        rows: (primitive_count, ROW).
        families: their families.
        samples: target distances at the points of the loss.
        config: steps, sharpness, weight of the overlap rows.
        device: where to evaluate.
        should_stop: asked before each step; True returns the best so far.

    Returns:
        Refined rows (primitive_count, ROW) float32; blends and gates unchanged.
    """
    if not len(rows):
        return rows
    blocks = point_blocks(samples.points, device)
    ranges = fit_ranges(families)
    primitives = PrimitiveSet(rows, families, device)
    rows = rows.astype(np.float32).copy()
    values = wp.empty(len(rows) * blocks.x.shape[0], dtype=float, device=device)
    scratch = (values, *ownership_arrays(blocks))
    damping = 1e-2
    low, high = config.betas
    system, loss, beta = None, np.inf, low
    for step in range(config.iterations):
        if should_stop():
            break
        wanted = low * (high / low) ** min(1.0, step / max(1, 0.7 * config.iterations))
        if system is None or wanted > 1.3 * beta:
            beta = wanted
            primitives.set_rows(rows)
            system, loss = _linearise(primitives, blocks, samples, beta, config, scratch)
        trial = apply_steps(rows, solve_steps(system, rows, np.full(len(rows), damping), ranges), ranges)
        primitives.set_rows(trial)
        tried, trial_loss = _linearise(primitives, blocks, samples, beta, config, scratch)
        if trial_loss < loss:
            rows, system, loss = trial, tried, trial_loss
            damping = max(damping * 0.4, 1e-5)
        else:
            damping = min(damping * 6.0, 1e3)
    return rows


def _linearise(
    primitives: PrimitiveSet,
    blocks: PointBlocks,
    samples: ObjectiveSamples,
    beta: float,
    config: RefineConfig,
    scratch: tuple[wp.array, ...],
) -> tuple[np.ndarray, float]:
    """Systems of all primitives and the loss: mean weighted squared error plus the overlap's."""
    owners = find_owners(primitives, blocks, primitives_at(primitives, blocks, scratch[0]), scratch[1:])
    points, loss = _rows_of_loss(owners, samples, len(primitives), beta, config, primitives.device)
    return normal_equations(primitives, points, beta), loss


def _rows_of_loss(
    owners: Ownership,
    samples: ObjectiveSamples,
    primitive_count: int,
    beta: float,
    config: RefineConfig,
    device: wp.Device,
) -> tuple[OwnedPoints, float]:
    """The loss's rows, each given to the primitive that answers for it, and the loss itself."""
    active = np.flatnonzero((owners.union < MASK) | (samples.distance < MASK))
    blended = active[owners.share[active] < 0.98]
    covered = active[owners.runner_up[active] < 0.5 / beta]
    index = np.concatenate([active, blended, covered])
    primitive = np.concatenate([owners.owner[active], owners.second[blended], owners.second[covered]])
    own = np.concatenate([owners.nearest[active], owners.runner_up[blended]])
    offset = np.concatenate([owners.union[index[: len(own)]] - own, np.zeros(len(covered), np.float32)])
    slope = np.concatenate(
        [owners.share[active], 1.0 - owners.share[blended], np.ones(len(covered), np.float32)]
    )
    target = np.concatenate([samples.distance[index[: len(own)]], np.full(len(covered), EMPTY, np.float32)])
    push = np.sqrt(config.overlap)
    weight = np.sqrt(samples.weight[index])
    weight[len(own) :] *= push
    points = owned_points(
        samples.points[index], primitive, primitive_count, target, weight, offset, slope, device
    )
    error = _occupancy(owners.union[active], beta) - _occupancy(samples.distance[active], beta)
    crossing = _occupancy(owners.runner_up[covered], beta)
    loss = float((samples.weight[active] * error**2).sum(dtype=np.float64))
    loss += config.overlap * float((samples.weight[covered] * crossing**2).sum(dtype=np.float64))
    return points, loss


def _occupancy(distance: np.ndarray, beta: float) -> np.ndarray:
    return 1.0 / (1.0 + np.exp(np.clip(beta * distance, -40.0, 40.0)))
