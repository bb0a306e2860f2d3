"""From unbounded numbers to rows, on the tape: what a first-order optimiser moves.

Raw numbers of a primitive: translation (3), axis-angle (3), shape (SHAPE), blend, keep and drop logits: ROW in all.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from ..rows import BLEND_C, GATE_C, ROTATION_C, ROW_C, SHAPE, SHAPE_C, SHAPES_C, TRANSLATION_C
from ..runtime.launch import VECTOR_FLAGS
from ..runtime.module_loading import load
from .frame import rotation_from_axis_angle
from .primitive_set import PrimitiveSet

# The only module whose adjoint Warp generates: a few numbers a primitive, no loops that overwrite.
wp.set_module_options({"enable_backward": True, "cpu_compiler_flags": VECTOR_FLAGS})

RAW_TURN, RAW_SHAPE, RAW_BLEND, RAW_KEEP, RAW_DROP = 3, 6, 6 + SHAPE, 7 + SHAPE, 8 + SHAPE
RAW_TURN_C, RAW_SHAPE_C, RAW_BLEND_C = wp.constant(RAW_TURN), wp.constant(RAW_SHAPE), wp.constant(RAW_BLEND)
RAW_KEEP_C, RAW_DROP_C = wp.constant(RAW_KEEP), wp.constant(RAW_DROP)


@wp.kernel
def activate_rows_kernel(
    raw: wp.array[float],
    low: wp.array[float],
    high: wp.array[float],
    noise: wp.array[float],
    temperature: float,
    # outputs
    out_rows: wp.array[float],
):
    """Pose as it is, shape by the logistic map onto its range, blend by softplus, gate by Gumbel softmax."""
    k = wp.tid()
    a = k * ROW_C
    for m in range(3):
        out_rows[a + TRANSLATION_C + m] = raw[a + m]
    q = rotation_from_axis_angle(raw[a + RAW_TURN_C], raw[a + RAW_TURN_C + 1], raw[a + RAW_TURN_C + 2])
    out_rows[a + ROTATION_C] = q[3]
    for m in range(3):
        out_rows[a + ROTATION_C + 1 + m] = q[m]
    for m in range(SHAPE_C):
        share = 1.0 / (1.0 + wp.exp(-raw[a + RAW_SHAPE_C + m]))
        at = k * SHAPE_C + m
        out_rows[a + SHAPES_C + m] = low[at] + (high[at] - low[at]) * share
    out_rows[a + BLEND_C] = wp.log(1.0 + wp.exp(raw[a + RAW_BLEND_C]))
    lead = raw[a + RAW_KEEP_C] + noise[2 * k] - raw[a + RAW_DROP_C] - noise[2 * k + 1]
    out_rows[a + GATE_C] = 1.0 / (1.0 + wp.exp(-lead / temperature))


def activate_rows(
    raw: wp.array,
    low: wp.array,
    high: wp.array,
    noise: np.ndarray,
    temperature: float,
    primitives: PrimitiveSet,
    tape: wp.Tape,
) -> None:
    """Set the rows of `primitives` from raw numbers as a step of `tape`, and derive.

    Args:
        raw: (primitive_count * ROW,) with a gradient.
        low, high: (primitive_count * SHAPE,) ranges of the shapes.
        noise: (primitive_count, 2) Gumbel noise of the existence logits; zeros for none.
        temperature: of the existence softmax.
        primitives: its `rows` require a gradient.
        tape: records the launch.
    """
    if not len(primitives):
        return
    device = primitives.device
    load(activate_rows_kernel, device)
    gumbel = wp.array(np.asarray(noise, np.float32).ravel(), dtype=float, device=device)
    with tape:
        wp.launch(
            activate_rows_kernel,
            len(primitives),
            [raw, low, high, gumbel, float(temperature)],
            [primitives.rows],
            device=device,
        )
    primitives.derive()
