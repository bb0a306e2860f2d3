"""The union as one differentiable step of a `wp.Tape`, with a hand-written adjoint.

Forward: every primitive at every point, folded on into the union (see `adjoint_kernels`). Backward: the fold undone
from its end gives each primitive its weight at each point, under which value and derivatives, evaluated again, are
summed over a block; the blocks' sums are then added in a fixed order.
Warp's generated adjoint of a loop that overwrites a variable, such as a running minimum, is wrong without a warning.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..rows import BLEND_C, GATE_C, ROTATION_C, ROW_C, SHAPE_C, SHAPES_C, TRANSLATION_C
from ..runtime.launch import PLAIN_OPTIONS, launch
from .adjoint_kernels import BLEND_SUM_C, GATE_SUM_C, SUMS, SUMS_C, fold_kernels
from .block import launch_runs
from .combine import FAR
from .culling import lists_argument
from .frame import Frame, to_world_direction
from .points import BLOCK, PointBlocks, padded_count
from .primitive_set import PrimitiveSet

wp.set_module_options(PLAIN_OPTIONS)

FORWARD_SECONDS, BACKWARD_SECONDS = 2e-7, 4e-7
"""Of one block of points on one core: a primitive's value, folded on; and its derivatives, where it has any."""

LISTED = 0.1
"""About how many of the primitives are listed in a block of points that lie together. All three decide when a launch is
split."""

GROUP = 64
"""Blocks whose sums are added together first."""
GROUP_C = wp.constant(GROUP)


@wp.kernel
def add_group_kernel(
    first: int,
    sums: wp.array[float],
    ids: wp.array[int],
    counts: wp.array[int],
    primitive_count: int,
    block_count: int,
    # outputs
    out_partial: wp.array[float],
):
    """Add one column of all primitives' sums over a group of blocks, in order."""
    t = first + wp.tid()
    group = t / SUMS_C
    column = t - group * SUMS_C
    store = group * primitive_count
    for k in range(primitive_count):
        out_partial[(store + k) * SUMS_C + column] = 0.0
    for block in range(group * GROUP_C, wp.min((group + 1) * GROUP_C, block_count)):
        for n in range(counts[block]):
            slot = block * primitive_count + n
            at = (store + ids[slot]) * SUMS_C + column
            out_partial[at] = out_partial[at] + sums[slot * SUMS_C + column]


@wp.kernel
def add_groups_kernel(
    first: int,
    partial: wp.array[float],
    stride: int,
    group_count: int,
    # outputs
    out_totals: wp.array[float],
):
    """Add one sum of one primitive over the groups, in order."""
    t = first + wp.tid()
    total = float(0.0)
    for group in range(group_count):
        total += partial[group * stride + t]
    out_totals[t] = total


@wp.kernel
def chain_rows_kernel(
    first: int,
    totals: wp.array[float],
    rows: wp.array[float],
    frames: wp.array[Frame],
    # outputs
    out_rows_grad: wp.array[float],
):
    """From local increments to the entries of a row: world translation, quaternion, shape, blend, gate; accumulates."""
    k = first + wp.tid()
    row = k * ROW_C
    sums = k * SUMS_C
    tx, ty, tz = to_world_direction(frames[k], totals[sums], totals[sums + 1], totals[sums + 2])
    out_rows_grad[row + TRANSLATION_C] += tx
    out_rows_grad[row + TRANSLATION_C + 1] += ty
    out_rows_grad[row + TRANSLATION_C + 2] += tz
    # A local turn w moves the quaternion q by q (0, w) / 2; q is normalised where it is used.
    w = rows[row + ROTATION_C]
    i = rows[row + ROTATION_C + 1]
    j = rows[row + ROTATION_C + 2]
    h = rows[row + ROTATION_C + 3]
    scale = 2.0 / wp.max(w * w + i * i + j * j + h * h, 1.0e-30)
    a = totals[sums + 3] * scale
    b = totals[sums + 4] * scale
    c = totals[sums + 5] * scale
    out_rows_grad[row + ROTATION_C] += -(i * a + j * b + h * c)
    out_rows_grad[row + ROTATION_C + 1] += w * a + j * c - h * b
    out_rows_grad[row + ROTATION_C + 2] += w * b + h * a - i * c
    out_rows_grad[row + ROTATION_C + 3] += w * c + i * b - j * a
    for m in range(SHAPE_C):
        out_rows_grad[row + SHAPES_C + m] += totals[sums + 6 + m]
    out_rows_grad[row + BLEND_C] += totals[sums + BLEND_SUM_C]
    out_rows_grad[row + GATE_C] += totals[sums + GATE_SUM_C]


@dataclass(frozen=True)
class _Folded:
    """Intermediate results of the forward step; slots as in `adjoint_kernels`."""

    field: wp.array
    values: wp.array
    """(primitive_count * padded points,) block by block; there only where a loss may ask for them."""
    shares: wp.array
    ids: wp.array
    """(block_count * primitive_count,): the primitive in each slot."""
    counts: wp.array
    """(block_count,): slots in use."""


def differentiable_union(primitives: PrimitiveSet, blocks: PointBlocks, tape: wp.Tape) -> wp.array:
    """The smooth union at every point as a step of `tape`, differentiable to all rows.

    Args:
        primitives: their `rows` must require a gradient; call `derive` after changing them.
        blocks: the points; their padding must get no weight from the loss. Faster if neighbours in the list are
            neighbours in space.
        tape: records the backward step: `rows.grad` gets the derivatives to translation (world), quaternion (of the
            normalised rotation), shape, blend (0 for the first) and gate.

    Returns:
        (padded points,) float32 with a gradient, normalised units, negative inside.
    """
    folded = _fold(primitives, blocks, list_all=False)
    if len(primitives) and blocks.block_count:
        tape.record_func(lambda: _unfold(primitives, blocks, folded), [primitives.rows, folded.field])
    return folded.field


def differentiable_assembly(
    primitives: PrimitiveSet, blocks: PointBlocks, tape: wp.Tape
) -> tuple[wp.array, wp.array]:
    """The union, and every primitive alone, as a step of `tape`; see `differentiable_union`.

    Returns:
        The union (padded points,), and the ungated distances (primitive_count * padded points,), block by block as
        `by_primitive` reads and `by_block` writes them. A loss on single primitives gives the derivative to their
        *gated* distance as the gradient of the latter.
    """
    folded = _fold(primitives, blocks, list_all=True)
    if len(primitives) and blocks.block_count:
        tape.record_func(
            lambda: _unfold(primitives, blocks, folded), [primitives.rows, folded.field, folded.values]
        )
    return folded.field, folded.values


def by_primitive(values: wp.array, primitive_count: int, count: int) -> np.ndarray:
    """Distances from `differentiable_assembly` as (primitive_count, count), without the padding."""
    blocked = values.numpy()[: primitive_count * padded_count(count)].reshape(-1, primitive_count, BLOCK)
    return blocked.transpose(1, 0, 2).reshape(primitive_count, -1)[:, :count]


def by_block(values: np.ndarray) -> np.ndarray:
    """Numbers (primitive_count, count) in the order of `differentiable_assembly`, flat float32; 0 in the padding."""
    primitive_count, count = values.shape
    padded = np.zeros((primitive_count, padded_count(count)), np.float32)
    padded[:, :count] = values
    return padded.reshape(primitive_count, -1, BLOCK).transpose(1, 0, 2).ravel()


def _fold(primitives: PrimitiveSet, blocks: PointBlocks, list_all: bool) -> _Folded:
    """The forward step; `list_all` gives every primitive its slot, for losses on single primitives."""
    device, count, size = blocks.device, len(primitives), blocks.x.shape[0]
    pairs = max(1, count * blocks.block_count)
    folded = _Folded(
        wp.empty(max(1, size), dtype=float, device=device, requires_grad=True),
        wp.empty(max(1, count * size * list_all), dtype=float, device=device, requires_grad=list_all),
        wp.empty(max(1, count * size), dtype=float, device=device),
        wp.empty(pairs, dtype=int, device=device),
        wp.empty(max(1, blocks.block_count), dtype=int, device=device),
    )
    if not count or not size:
        folded.field.fill_(FAR)
    launch_runs(
        lambda name: fold_kernels(name)[0],
        primitives,
        blocks.block_count,
        [blocks.points, int(list_all)],
        [folded.values, folded.shares, folded.field, folded.ids, folded.counts],
        FORWARD_SECONDS,
    )
    return folded


def _unfold(primitives: PrimitiveSet, blocks: PointBlocks, folded: _Folded) -> None:
    """Add the rows' gradient, given those of the union and, where they have one, of the primitives' distances."""
    device, count, block_count = blocks.device, len(primitives), blocks.block_count
    groups = -(-block_count // GROUP)
    asked = folded.values.grad
    sums = wp.empty(count * block_count * SUMS, dtype=float, device=device)
    partial = wp.empty(groups * count * SUMS, dtype=float, device=device)
    totals = wp.empty(count * SUMS, dtype=float, device=device)
    for_values = wp.zeros(BLOCK, dtype=float, device=device) if asked is None else asked
    carry = wp.clone(folded.field.grad)
    launch_runs(
        lambda name: fold_kernels(name)[1],
        primitives,
        block_count,
        [
            blocks.points,
            lists_argument(folded.ids, folded.counts),
            folded.shares,
            for_values,
            int(asked is not None),
        ],
        [carry, sums],
        BACKWARD_SECONDS * (LISTED if asked is None else 1.0),
        reversed(primitives.runs),
    )
    launch(
        add_group_kernel,
        groups * SUMS,
        [sums, folded.ids, folded.counts, count, block_count],
        [partial],
        device,
        seconds_per_thread=3e-9 * GROUP * count * (LISTED if asked is None else 1.0),
    )
    launch(add_groups_kernel, count * SUMS, [partial, count * SUMS, groups], [totals], device)
    launch(
        chain_rows_kernel,
        count,
        [totals, primitives.rows, primitives.frames],
        [primitives.rows.grad],
        device,
    )
