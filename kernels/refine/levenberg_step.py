"""Damped steps of many primitives: what to keep of the last trial, the next trial, and its damping, on the device.

`rows` and `systems` are the best so far, `trial_rows` and `trial_systems` what was just evaluated. A judge says which
trials to keep: each primitive by its own error, or all by the loss that they share. Then every primitive solves its
damped normal equations and writes its next trial.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..field.combine import FAR
from ..field.primitive_set import PrimitiveSet
from ..rows import BLEND_C, GATE_C, ROTATION_C, ROW, ROW_C, SHAPE_C, SHAPES_C, TRANSLATION_C
from ..runtime.launch import launch
from .block_solve import (
    BLEND_UNKNOWN,
    FIRST_SHAPE,
    SOLVER_OPTIONS,
    SYSTEM,
    SYSTEM_C,
    UNKNOWNS,
    SystemRow,
    damped_step,
)

wp.set_module_options(SOLVER_OPTIONS)

FIRST_DAMPING = 1e-2

TRANSLATION_LIMIT, ROTATION_LIMIT = wp.constant(0.15), wp.constant(0.4)
SHAPE_LIMIT, BLEND_LIMIT = wp.constant(0.25), wp.constant(0.02)
"""Longest move of each unknown in one step: beyond it the linear model says nothing about the field."""


@dataclass(frozen=True)
class Damping:
    """Damping schedule: factors after a better or worse trial, and limits."""

    better: float
    worse: float
    least: float
    most: float = 1e3


@dataclass(frozen=True)
class StepState:
    """State of a sequence of steps; flat float32 arrays but for `kept`."""

    rows: wp.array
    """(primitive_count * ROW,) the best so far."""
    systems: wp.array
    """(primitive_count * SYSTEM^2,) its systems."""
    trial_systems: wp.array
    """The same of the trial."""
    loss: wp.array
    """(primitive_count,) of the best so far, FAR before the first trial; where it is shared, the first entry."""
    damping: wp.array
    """(primitive_count,)."""
    kept: wp.array
    """(primitive_count,) int32, 1 where the trial is to be kept."""
    low: wp.array
    high: wp.array
    """(primitive_count * SHAPE,) ranges of the shapes."""


def step_state(rows: np.ndarray, low: np.ndarray, high: np.ndarray, device: wp.Device) -> StepState:
    """The state before the first trial, which is the given rows themselves.

    Args:
        rows: (primitive_count, ROW).
        low, high: (primitive_count, SHAPE) ranges of the shapes; equal ones hold a shape.
        device: where the state lies.
    """
    count = len(rows)

    def on_device(values: np.ndarray) -> wp.array:
        return wp.array(np.ascontiguousarray(values, np.float32).ravel(), dtype=float, device=device)

    systems = [wp.zeros(max(1, count * SYSTEM * SYSTEM), dtype=float, device=device) for _ in range(2)]
    return StepState(
        on_device(rows),
        *systems,
        loss=wp.full(max(1, count), float(FAR), dtype=float, device=device),
        damping=wp.full(max(1, count), FIRST_DAMPING, dtype=float, device=device),
        kept=wp.zeros(max(1, count), dtype=int, device=device),
        low=on_device(low),
        high=on_device(high),
    )


@wp.func
def next_damping(before: float, loss: float, kept: bool, rule: wp.vec4) -> float:
    """The damping after a trial; the first one, which was no step, says nothing."""
    if loss >= FAR:
        return before
    if kept:
        return wp.max(before * rule[0], rule[2])
    return wp.min(before * rule[1], rule[3])


@wp.kernel
def judge_alone_kernel(
    first: int,
    trial_systems: wp.array[float],
    rule: wp.vec4,
    # outputs
    out_loss: wp.array[float],
    out_damping: wp.array[float],
    out_kept: wp.array[int],
):
    """Keep one primitive's trial if its own sum of squared residuals fell."""
    k = first + wp.tid()
    before = out_loss[k]
    tried = trial_systems[(k + 1) * SYSTEM_C * SYSTEM_C - 1]
    kept = tried < before
    out_damping[k] = next_damping(out_damping[k], before, kept, rule)
    out_kept[k] = wp.where(kept, 1, 0)
    out_loss[k] = wp.where(kept, tried, before)


@wp.kernel
def judge_together_kernel(
    first: int,
    block_loss: wp.array[float],
    block_count: int,
    primitive_count: int,
    rule: wp.vec4,
    # outputs
    out_loss: wp.array[float],
    out_damping: wp.array[float],
    out_kept: wp.array[int],
):
    """Keep all trials if the loss that they share fell; one thread."""
    total = wp.float64(0.0)
    for block in range(block_count):
        total += wp.float64(block_loss[block])
    tried = float(total)
    before = out_loss[0]
    kept = tried < before
    for k in range(first, primitive_count):
        out_damping[k] = next_damping(out_damping[k], before, kept, rule)
        out_kept[k] = wp.where(kept, 1, 0)
    if kept:
        out_loss[0] = tried


@wp.func
def move_row(
    rows: wp.array[float], row: int, step: SystemRow, low: wp.array[float], high: wp.array[float], bound: int,
    most_blend: float, out_rows: wp.array[float],
):  # fmt: skip
    """Write a row moved by local increments (see `rows`), their length limited, shapes clipped to their ranges."""
    w = rows[row + ROTATION_C]
    x = rows[row + ROTATION_C + 1]
    y = rows[row + ROTATION_C + 2]
    z = rows[row + ROTATION_C + 3]
    tx = wp.clamp(float(step[0]), -TRANSLATION_LIMIT, TRANSLATION_LIMIT)
    ty = wp.clamp(float(step[1]), -TRANSLATION_LIMIT, TRANSLATION_LIMIT)
    tz = wp.clamp(float(step[2]), -TRANSLATION_LIMIT, TRANSLATION_LIMIT)
    out_rows[row + TRANSLATION_C] = (
        rows[row + TRANSLATION_C]
        + (1.0 - 2.0 * (y * y + z * z)) * tx
        + 2.0 * (x * y - w * z) * ty
        + 2.0 * (x * z + w * y) * tz
    )
    out_rows[row + TRANSLATION_C + 1] = (
        rows[row + TRANSLATION_C + 1]
        + 2.0 * (x * y + w * z) * tx
        + (1.0 - 2.0 * (x * x + z * z)) * ty
        + 2.0 * (y * z - w * x) * tz
    )
    out_rows[row + TRANSLATION_C + 2] = (
        rows[row + TRANSLATION_C + 2]
        + 2.0 * (x * z - w * y) * tx
        + 2.0 * (y * z + w * x) * ty
        + (1.0 - 2.0 * (x * x + y * y)) * tz
    )
    a = 0.5 * wp.clamp(float(step[3]), -ROTATION_LIMIT, ROTATION_LIMIT)
    b = 0.5 * wp.clamp(float(step[4]), -ROTATION_LIMIT, ROTATION_LIMIT)
    c = 0.5 * wp.clamp(float(step[5]), -ROTATION_LIMIT, ROTATION_LIMIT)
    turned = wp.vec4(
        w - x * a - y * b - z * c,
        x + w * a + y * c - z * b,
        y + w * b + z * a - x * c,
        z + w * c + x * b - y * a,
    )
    turned = turned / wp.length(turned)
    for m in range(4):
        out_rows[row + ROTATION_C + m] = turned[m]
    for m in range(SHAPE_C):
        move = wp.clamp(float(step[FIRST_SHAPE + m]), -SHAPE_LIMIT, SHAPE_LIMIT)
        out_rows[row + SHAPES_C + m] = wp.clamp(
            rows[row + SHAPES_C + m] + move, low[bound + m], high[bound + m]
        )
    blend = rows[row + BLEND_C]
    wider = wp.clamp(blend + wp.clamp(float(step[BLEND_UNKNOWN]), -BLEND_LIMIT, BLEND_LIMIT), 0.0, most_blend)
    out_rows[row + BLEND_C] = wp.where(most_blend > 0.0, wp.where(blend > 0.0, wider, blend), blend)
    out_rows[row + GATE_C] = rows[row + GATE_C]


@wp.kernel
def advance_kernel(
    first: int,
    kept: wp.array[int],
    damping: wp.array[float],
    low: wp.array[float],
    high: wp.array[float],
    trial_systems: wp.array[float],
    most_blend: float,
    unknowns: int,
    # outputs
    rows: wp.array[float],
    systems: wp.array[float],
    trial_rows: wp.array[float],
):
    """Keep or drop one primitive's trial, and write its next."""
    k = first + wp.tid()
    size = SYSTEM_C * SYSTEM_C
    if kept[k] != 0:
        for m in range(k * ROW_C, (k + 1) * ROW_C):
            rows[m] = trial_rows[m]
        for m in range(k * size, (k + 1) * size):
            systems[m] = trial_systems[m]
    step = damped_step(
        systems, rows, low, high, most_blend, damping[k], k * size, k * ROW_C, k * SHAPE_C, unknowns
    )
    move_row(rows, k * ROW_C, step, low, high, k * SHAPE_C, most_blend, trial_rows)


def judge_alone(state: StepState, count: int, rule: Damping) -> None:
    """Say of each primitive whether its trial is kept, and set its damping."""
    launch(
        judge_alone_kernel,
        count,
        [state.trial_systems, _packed(rule)],
        [state.loss, state.damping, state.kept],
        state.rows.device,
    )


def judge_together(state: StepState, count: int, block_loss: wp.array, rule: Damping) -> None:
    """Say of all primitives at once whether their trial is kept; the loss is the sum of `block_loss`."""
    launch(
        judge_together_kernel,
        1,
        [block_loss, block_loss.shape[0], count, _packed(rule)],
        [state.loss, state.damping, state.kept],
        state.rows.device,
    )


def _packed(rule: Damping) -> wp.vec4:
    return wp.vec4(rule.better, rule.worse, rule.least, rule.most)


def advance(state: StepState, trial: PrimitiveSet, most_blend: float = 0.0) -> None:
    """Keep what the judge said, and move `trial` to the next trial.

    Args:
        state: best so far, judged.
        trial: what was just evaluated; its rows become the next trial's.
        most_blend: largest blend radius that is tried; 0 leaves the blends as they are.
    """
    # The blend is the last unknown: where it stays, there is one less.
    unknowns = UNKNOWNS if most_blend > 0.0 else UNKNOWNS - 1
    launch(
        advance_kernel,
        len(trial),
        [state.kept, state.damping, state.low, state.high, state.trial_systems, float(most_blend), unknowns],
        [state.rows, state.systems, trial.rows],
        state.rows.device,
        seconds_per_thread=3e-6,
    )
    trial.derive()


def rows_of(state: StepState) -> np.ndarray:
    """A copy of the best rows (primitive_count, ROW) on the host."""
    return state.rows.numpy().reshape(-1, ROW).copy()
