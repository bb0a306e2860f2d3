"""Joint refinement: all primitives follow the union's error together, each by its own damped step.

Points belong to the primitive nearest to them, so the normal matrix is nearly block-diagonal (design: second order
beats Adam). A point that a second primitive covers gives that one a row which pushes it out; where two blend,
both get the union's row. Owners change as primitives move: they are found anew at every step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..kernels.field import primitives_at
from ..kernels.normal_equations import normal_equations
from ..kernels.owned_points import OwnedPoints, owned_points
from ..kernels.points import PointBlocks, point_blocks
from ..kernels.primitive_set import PrimitiveSet
from ..kernels.rows import BLEND
from .config import RefineConfig
from .levenberg import apply_steps, fit_ranges, solve_steps
from .objective import ObjectiveSamples

MASK = 0.1
"""Points farther than this from both the target and the assembly, outside, are not in the loss (the paper's mask)."""

EMPTY = 1e30
"""Target distance of a row that wants its primitive elsewhere."""


@dataclass(frozen=True)
class Ownership:
    """What the union looks like at each sample point, from all primitives' distances there."""

    union: np.ndarray
    """(n,) smooth union."""
    owner: np.ndarray
    """(n,) primitive with the smallest distance."""
    nearest: np.ndarray
    """(n,) that distance."""
    second: np.ndarray
    """(n,) primitive with the second smallest distance; the owner again where there is only one primitive."""
    runner_up: np.ndarray
    """(n,) that distance."""
    share: np.ndarray
    """(n,) derivative of the union to the owner's distance, as far as these two go; the second has the rest."""


def find_owners(values: np.ndarray, blends: np.ndarray) -> Ownership:
    """Owners from distances (primitive_count, n) and blend radii (primitive_count,)."""
    count, columns = values.shape[0], np.arange(values.shape[1])
    owner = values.argmin(0)
    nearest = values[owner, columns]
    if count == 1:
        return Ownership(nearest, owner, nearest, owner, np.full_like(nearest, EMPTY), np.ones_like(nearest))
    others = values.copy()
    others[owner, columns] = np.inf
    second = others.argmin(0)
    runner_up = others[second, columns]
    blend = blends[np.maximum(owner, second)]
    share = np.clip(0.5 + 0.5 * (runner_up - nearest) / np.maximum(blend, 1e-9), 0.5, 1.0)
    return Ownership(fold(values, blends), owner, nearest, second, runner_up, share.astype(np.float32))


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
            system, loss = _linearise(primitives, blocks, samples, beta, config)
        trial = apply_steps(rows, solve_steps(system, rows, np.full(len(rows), damping), ranges), ranges)
        primitives.set_rows(trial)
        tried, trial_loss = _linearise(primitives, blocks, samples, beta, config)
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
) -> tuple[np.ndarray, float]:
    """Systems of all primitives and the loss: mean weighted squared error plus the overlap's."""
    values = primitives_at(primitives, blocks).numpy().reshape(len(primitives), -1)[:, : blocks.count]
    owners = find_owners(values, primitives.blends)
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


def set_blends(rows: np.ndarray, blend: float) -> np.ndarray:
    """Rows with every blend set to `blend`; the first one's is unused."""
    changed = rows.copy()
    changed[:, BLEND] = blend
    return changed
