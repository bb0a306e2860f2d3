"""Damped Gauss-Newton steps of many primitives at once (Levenberg-Marquardt), on the kernels' normal equations.

Each primitive is a problem of its own with TANGENT unknowns: local translation and rotation, and its shape inside the
family's fit range. Nothing is shared between them, so thousands of starts advance together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.primitives import family
from ...kernels.refine.levenberg_step import Damping, advance, judge_alone, rows_of, step_state
from ...kernels.refine.normal_equations import normal_equations_at, partial_systems
from ...kernels.refine.point_batches import PointBatches
from ...kernels.rows import SHAPE, SHAPES
from ...kernels.runtime.launch_graph import LaunchGraph

OWN_DAMPING = Damping(better=0.3, worse=5.0, least=1e-6)


@dataclass(frozen=True)
class Ranges:
    """Bounds of the shapes, (primitive_count, SHAPE) each; equal where a family lacks the parameter."""

    low: np.ndarray
    high: np.ndarray


def fit_ranges(families: Sequence[str]) -> Ranges:
    """The fit ranges of each primitive's family."""
    bounds = {name: family(name).fit_range for name in set(families)}
    low, high = (
        np.array([bounds[name][side] for name in families], np.float32).reshape(-1, SHAPE)
        for side in range(2)
    )
    return Ranges(low, high)


def levenberg(
    rows: np.ndarray,
    families: Sequence[str],
    points: PointBatches,
    betas: np.ndarray,
    iterations: int,
    device: wp.Device,
) -> tuple[np.ndarray, np.ndarray]:
    """Fit every primitive to its own points; each keeps its best.

    Args:
        rows: (primitive_count, ROW) starts.
        families: their families.
        points: what each primitive should match.
        betas: (primitive_count,) sharpness, per normalised unit.
        iterations: steps tried; each costs one pass over the points.
        device: where `points` are.

    Returns:
        Fitted rows (primitive_count, ROW) float32 and their sums of squared residuals (primitive_count,).
    """
    count, ranges = len(rows), fit_ranges(families)
    rows = rows.astype(np.float32)
    rows[:, SHAPES : SHAPES + SHAPE] = np.clip(rows[:, SHAPES : SHAPES + SHAPE], ranges.low, ranges.high)
    if not count:
        return rows, np.zeros(0, np.float32)
    trial = PrimitiveSet(rows, families, device)
    state = step_state(rows, ranges.low, ranges.high, device)
    partial = partial_systems(points, device)
    sharpness = wp.array(np.asarray(betas, np.float32), dtype=float, device=device)

    def step() -> None:
        normal_equations_at(trial, points, sharpness, partial, state.trial_systems)
        judge_alone(state, count, OWN_DAMPING)
        advance(state, trial)

    # The first time round the trial is the start itself; it loads the kernels, so that a GPU may capture the others.
    step()
    run = LaunchGraph(step, device)
    for _ in range(iterations):
        run()
    return rows_of(state), state.loss.numpy().copy()
