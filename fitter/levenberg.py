"""Damped Gauss-Newton steps of many primitives at once (Levenberg-Marquardt), on the kernels' normal equations.

Each primitive is a problem of its own with TANGENT unknowns: local translation and rotation, and its shape inside the
family's fit range. Nothing is shared between them, so thousands of starts advance together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..kernels.normal_equations import SYSTEM, normal_equations_at
from ..kernels.owned_points import OwnedPoints
from ..kernels.primitive_set import PrimitiveSet
from ..kernels.primitives import family
from ..kernels.rows import ROTATION, SHAPE, SHAPES, TANGENT, TRANSLATION

STEP_LIMIT = np.array([0.15] * 3 + [0.4] * 3 + [0.25] * SHAPE)
"""Longest move of each unknown in one step: beyond it the linear model says nothing about the field."""


@dataclass(frozen=True)
class Ranges:
    """Where shapes may go, one row a primitive; columns that a family lacks, or that are held, are `frozen`."""

    low: np.ndarray
    high: np.ndarray
    frozen: np.ndarray
    """(primitive_count, TANGENT) bool."""


def fit_ranges(families: Sequence[str]) -> Ranges:
    """The fit ranges of each primitive's family."""
    if not families:
        empty = np.zeros((0, SHAPE), np.float32)
        return Ranges(empty, empty, np.zeros((0, TANGENT), bool))
    bounds = {name: family(name).fit_range for name in set(families)}
    low = np.stack([bounds[name][0] for name in families])
    high = np.stack([bounds[name][1] for name in families])
    frozen = np.zeros((len(families), TANGENT), bool)
    frozen[:, TANGENT - SHAPE :] = high <= low
    return Ranges(low, high, frozen)


def solve_steps(systems: np.ndarray, rows: np.ndarray, damping: np.ndarray, ranges: Ranges) -> np.ndarray:
    """Increments (primitive_count, TANGENT) that lower each system's residual.

    Args:
        systems: (primitive_count, SYSTEM, SYSTEM) from `normal_equations`.
        rows: (primitive_count, ROW): shapes on a bound do not move further out.
        damping: (primitive_count,), relative to the system's diagonal.
        ranges: bounds of the shapes.
    """
    matrix = systems[:, :TANGENT, :TANGENT].astype(np.float64)
    slope = systems[:, :TANGENT, TANGENT].astype(np.float64)
    shapes = rows[:, SHAPES : SHAPES + SHAPE]
    held = ranges.frozen.copy()
    held[:, TANGENT - SHAPE :] |= (shapes <= ranges.low) & (slope[:, TANGENT - SHAPE :] > 0)
    held[:, TANGENT - SHAPE :] |= (shapes >= ranges.high) & (slope[:, TANGENT - SHAPE :] < 0)
    free = ~held
    matrix *= free[:, :, None] & free[:, None, :]
    slope *= free
    diagonal = np.einsum("kii->ki", matrix)
    scale = diagonal.mean(1, keepdims=True) + 1e-12
    diagonal += damping[:, None] * diagonal + 1e-4 * scale * damping[:, None] + 1e-7 * scale + held * scale
    steps = -np.linalg.solve(matrix, slope[..., None])[..., 0]
    return np.clip(steps, -STEP_LIMIT, STEP_LIMIT)


def apply_steps(rows: np.ndarray, steps: np.ndarray, ranges: Ranges) -> np.ndarray:
    """Rows moved by local increments (see `kernels.rows`), shapes clipped to their ranges."""
    moved = rows.astype(np.float64)
    w, x, y, z = (moved[:, ROTATION + i] for i in range(4))
    tx, ty, tz = steps[:, 0], steps[:, 1], steps[:, 2]
    moved[:, TRANSLATION] += (
        (1 - 2 * (y * y + z * z)) * tx + 2 * (x * y - w * z) * ty + 2 * (x * z + w * y) * tz
    )
    moved[:, TRANSLATION + 1] += (
        2 * (x * y + w * z) * tx + (1 - 2 * (x * x + z * z)) * ty + 2 * (y * z - w * x) * tz
    )
    moved[:, TRANSLATION + 2] += (
        2 * (x * z - w * y) * tx + 2 * (y * z + w * x) * ty + (1 - 2 * (x * x + y * y)) * tz
    )
    a, b, c = 0.5 * steps[:, 3], 0.5 * steps[:, 4], 0.5 * steps[:, 5]
    turned = np.stack(
        [
            w - x * a - y * b - z * c,
            x + w * a + y * c - z * b,
            y + w * b + z * a - x * c,
            z + w * c + x * b - y * a,
        ],
        axis=1,
    )
    moved[:, ROTATION : ROTATION + 4] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    shapes = moved[:, SHAPES : SHAPES + SHAPE] + steps[:, TANGENT - SHAPE :]
    moved[:, SHAPES : SHAPES + SHAPE] = np.clip(shapes, ranges.low, ranges.high)
    return moved.astype(np.float32)


def levenberg(
    rows: np.ndarray,
    families: Sequence[str],
    points: OwnedPoints,
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
    count = len(rows)
    ranges = fit_ranges(families)
    rows = apply_steps(rows, np.zeros((count, TANGENT)), ranges)
    primitives = PrimitiveSet(rows, families, device)
    partial = wp.zeros(max(1, points.pair_count * SYSTEM * SYSTEM), dtype=float, device=device)
    out = wp.zeros(max(1, count * SYSTEM * SYSTEM), dtype=float, device=device)
    sharpness = wp.array(np.asarray(betas, np.float32), dtype=float, device=device)

    def systems_of(candidate: np.ndarray) -> np.ndarray:
        primitives.set_rows(candidate)
        normal_equations_at(primitives, points, sharpness, partial, out)
        return out.numpy()[: count * SYSTEM * SYSTEM].reshape(-1, SYSTEM, SYSTEM)

    systems = systems_of(rows).copy()
    damping = np.full(count, 1e-2)
    for _ in range(iterations):
        trial = apply_steps(rows, solve_steps(systems, rows, damping, ranges), ranges)
        tried = systems_of(trial)
        better = tried[:, TANGENT, TANGENT] < systems[:, TANGENT, TANGENT]
        rows[better] = trial[better]
        systems[better] = tried[better]
        damping = np.clip(np.where(better, damping * 0.3, damping * 5.0), 1e-6, 1e3)
    return rows, systems[:, TANGENT, TANGENT].copy()
