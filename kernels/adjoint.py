"""The union as one differentiable step of a `wp.Tape`, with a hand-written adjoint.

Forward: every primitive at every point, then the fold of the union, whose prefixes are kept. Backward: the fold
undone from its end (spec section 12) gives each primitive its weight at each point; a second kernel evaluates value
and derivatives again and sums them under these weights over blocks of points; blocks are then added in a fixed order.
Warp's generated adjoint of a loop that overwrites a variable, such as a running minimum, is wrong without a warning.
"""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

from functools import cache

import warp as wp

from .field import primitives_at
from .frame import Frame, to_local, to_world_direction
from .jacobian import TANGENT_C, JacobianRow, jacobian_row
from .launch import PLAIN_OPTIONS, VECTOR_OPTIONS, launch
from .points import BLOCK, BLOCK_C, PointBlocks
from .primitive_set import PrimitiveSet
from .primitives import family
from .rows import BLEND_C, GATE_C, ROTATION_C, ROW_C, SHAPE_C, SHAPES_C, TANGENT, TRANSLATION_C
from .union import FAR, gated, quarter_inverse, smooth_minimum, smooth_minimum_share
from .vector_math import larger

BLOCK_SECONDS = 4e-7
"""Value, derivatives and weighted sum of one primitive over one block of points, on one core."""

SUMS = TANGENT + 2
"""Sums a block keeps of each primitive: its Jacobian's columns, blend and gate."""
SUMS_C = wp.constant(SUMS)
BLEND_SUM_C, GATE_SUM_C = wp.constant(TANGENT), wp.constant(TANGENT + 1)

FOLD = "resfit.kernels.adjoint.fold"
wp.set_module_options(VECTOR_OPTIONS, module=FOLD)
CHAIN = "resfit.kernels.adjoint.chain"
wp.set_module_options(PLAIN_OPTIONS, module=CHAIN)


@wp.kernel(module=FOLD)
def fold_values_kernel(
    first: int,
    values: wp.array[float],
    rows: wp.array[float],
    primitive_count: int,
    size: int,
    # outputs
    out_prefix: wp.array[float],
    out_field: wp.array[float],
):
    """Fold one block of points; keeps the union of the first k + 1 primitives in `out_prefix`."""
    base = (first + wp.tid()) * BLOCK_C
    for j in range(BLOCK_C):
        out_field[base + j] = FAR
    for k in range(primitive_count):
        blend = rows[k * ROW_C + BLEND_C]
        gate = rows[k * ROW_C + GATE_C]
        quarter = quarter_inverse(blend)
        at = k * size + base
        for j in range(BLOCK_C):
            folded = smooth_minimum(out_field[base + j], gated(values[at + j], gate), blend, quarter)
            out_prefix[at + j] = folded
            out_field[base + j] = folded


@wp.kernel(module=FOLD)
def unfold_values_kernel(
    first: int,
    values: wp.array[float],
    prefix: wp.array[float],
    rows: wp.array[float],
    primitive_count: int,
    size: int,
    block_count: int,
    # outputs
    carry: wp.array[float],
    out_weights: wp.array[float],
    out_sums: wp.array[float],
):
    """Undo the fold of one block: the loss's derivative to each primitive's own value, and the sums for blend and gate.

    `carry` comes in as the derivative to the union and is used up.
    """
    block = first + wp.tid()
    base = block * BLOCK_C
    for back in range(primitive_count):
        k = primitive_count - 1 - back
        blend = rows[k * ROW_C + BLEND_C]
        gate = rows[k * ROW_C + GATE_C]
        quarter = quarter_inverse(blend)
        at = k * size + base
        blend_sum = float(0.0)
        gate_sum = float(0.0)
        if k > 0:
            for j in range(BLOCK_C):
                value = values[at + j]
                keep = smooth_minimum_share(prefix[at - size + j], gated(value, gate), quarter)
                whole = carry[base + j]
                passed = whole * (1.0 - keep)
                blend_sum += -passed * keep
                gate_sum += passed * (value - 1.0)
                out_weights[at + j] = passed * gate
                carry[base + j] = whole * keep
        else:
            for j in range(BLOCK_C):
                passed = carry[base + j]
                gate_sum += passed * (values[at + j] - 1.0)
                out_weights[at + j] = passed * gate
        store = (k * block_count + block) * SUMS_C
        out_sums[store + BLEND_SUM_C] = blend_sum
        out_sums[store + GATE_SUM_C] = gate_sum


@cache
def weighted_sum_kernel(name: str) -> wp.Kernel:
    """The kernel of the family `name` that sums weight x Jacobian row over one block of one primitive."""
    module = f"resfit.kernels.adjoint.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    entry = family(name)
    table = entry.table
    sdf_grad = entry.sdf_grad
    fast_grad = entry.fast_grad or entry.sdf_grad
    has_slow_zone = entry.slow_zone is not None
    slow_zone = entry.slow_zone or entry.sdf

    @wp.kernel(module=module)
    def sum_weighted_jacobian_kernel(
        first: int,
        x: wp.array[float],
        y: wp.array[float],
        z: wp.array[float],
        frames: wp.array[Frame],
        tables: wp.array[table],
        weights: wp.array[float],
        begin: int,
        block_count: int,
        # outputs
        out_sums: wp.array[float],
    ):
        t = first + wp.tid()
        run_k = t / block_count
        block = t - run_k * block_count
        k = begin + run_k
        base = block * BLOCK_C
        at = (k * block_count + block) * BLOCK_C
        f = frames[k]
        s = tables[k]
        total = JacobianRow()
        slow = float(-1.0)
        if wp.static(has_slow_zone):
            for j in range(BLOCK_C):
                px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                slow = larger(slow, slow_zone(s, px, py, pz))
        if slow > 0.0:
            for j in range(BLOCK_C):
                px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                w = weights[at + j]
                d = sdf_grad(s, px, py, pz)
                total += w * jacobian_row(px, py, pz, d)
        else:
            for j in range(BLOCK_C):
                px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                w = weights[at + j]
                d = fast_grad(s, px, py, pz)
                total += w * jacobian_row(px, py, pz, d)
        store = (k * block_count + block) * SUMS_C
        for m in range(TANGENT_C):
            out_sums[store + m] = total[m]

    return sum_weighted_jacobian_kernel


@wp.kernel(module=CHAIN)
def add_blocks_kernel(
    first: int,
    sums: wp.array[float],
    block_count: int,
    # outputs
    out_totals: wp.array[float],
):
    """Add one sum of one primitive over the blocks, in order."""
    t = first + wp.tid()
    k = t / SUMS_C
    column = t - k * SUMS_C
    total = float(0.0)
    for block in range(block_count):
        total += sums[(k * block_count + block) * SUMS_C + column]
    out_totals[t] = total


@wp.kernel(module=CHAIN)
def add_values_grad_kernel(
    first: int,
    values_grad: wp.array[float],
    rows: wp.array[float],
    size: int,
    # outputs
    out_weights: wp.array[float],
):
    """Add what a loss asks of each primitive's own, gated distance to the weights that come through the union."""
    t = first + wp.tid()
    out_weights[t] = out_weights[t] + values_grad[t] * rows[(t / size) * ROW_C + GATE_C]


@wp.kernel(module=CHAIN)
def add_gate_grad_kernel(
    first: int,
    values: wp.array[float],
    values_grad: wp.array[float],
    # outputs
    out_sums: wp.array[float],
):
    """The same for the gates' sums of one block of one primitive."""
    t = first + wp.tid()
    total = float(0.0)
    for j in range(BLOCK_C):
        total += values_grad[t * BLOCK_C + j] * (values[t * BLOCK_C + j] - 1.0)
    out_sums[t * SUMS_C + GATE_SUM_C] = out_sums[t * SUMS_C + GATE_SUM_C] + total


@wp.kernel(module=CHAIN)
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
    if k > 0:
        out_rows_grad[row + BLEND_C] += totals[sums + BLEND_SUM_C]
    out_rows_grad[row + GATE_C] += totals[sums + GATE_SUM_C]


def weighted_sums(
    primitives: PrimitiveSet, blocks: PointBlocks, weights: wp.array, out_sums: wp.array
) -> None:
    """Fill the Jacobian's columns of `out_sums` (primitive_count * block_count * SUMS,) under per-point weights.

    `weights` is (primitive_count * padded points,), primitive-major; 0 where a point does not count.
    """
    for run in primitives.runs:
        launch(
            weighted_sum_kernel(run.family.name),
            run.count * blocks.block_count,
            [
                blocks.x,
                blocks.y,
                blocks.z,
                primitives.frames,
                primitives.tables[run.family.name],
                weights,
                run.begin,
                blocks.block_count,
            ],
            [out_sums],
            blocks.device,
            seconds_per_thread=BLOCK_SECONDS,
        )


def differentiable_union(primitives: PrimitiveSet, blocks: PointBlocks, tape: wp.Tape) -> wp.array:
    """The smooth union at every point as a step of `tape`, differentiable to all rows.

    Args:
        primitives: their `rows` must require a gradient; call `derive` after changing them.
        blocks: the points; their padding must get no weight from the loss.
        tape: records the backward step: `rows.grad` gets the derivatives to translation (world), quaternion (of the
            normalised rotation), shape, blend (0 for the first) and gate.

    Returns:
        (padded points,) float32 with a gradient, normalised units, negative inside.
    """
    return differentiable_assembly(primitives, blocks, tape, values_need_grad=False)[0]


def differentiable_assembly(
    primitives: PrimitiveSet, blocks: PointBlocks, tape: wp.Tape, values_need_grad: bool = True
) -> tuple[wp.array, wp.array]:
    """The union, and every primitive alone, as a step of `tape`; see `differentiable_union`.

    Returns:
        The union (padded points,), and the ungated distances (primitive_count * padded points,), primitive-major. A
        loss on single primitives gives the derivative to their *gated* distance as the gradient of the latter.
    """
    device, count, size = blocks.device, len(primitives), blocks.x.shape[0]
    field = wp.empty(max(1, size), dtype=float, device=device, requires_grad=True)
    values = wp.empty(max(1, count * size), dtype=float, device=device, requires_grad=values_need_grad)
    if not count or not size:
        field.fill_(FAR)
        return field, values
    primitives_at(primitives, blocks, values)
    prefix = wp.empty(count * size, dtype=float, device=device)
    launch(
        fold_values_kernel,
        blocks.block_count,
        [values, primitives.rows, count, size],
        [prefix, field],
        device,
        seconds_per_thread=BLOCK * 1e-9 * count,
    )
    outputs = [field, values] if values_need_grad else [field]
    tape.record_func(
        lambda: _differentiate(primitives, blocks, field, values, prefix), [primitives.rows, *outputs]
    )
    return field, values


def _differentiate(
    primitives: PrimitiveSet, blocks: PointBlocks, field: wp.array, values: wp.array, prefix: wp.array
) -> None:
    """Add the rows' gradient, given those of the union and, where they have one, of the primitives' distances."""
    device, count, size = blocks.device, len(primitives), blocks.x.shape[0]
    weights = wp.empty(count * size, dtype=float, device=device)
    sums = wp.empty(count * blocks.block_count * SUMS, dtype=float, device=device)
    totals = wp.empty(count * SUMS, dtype=float, device=device)
    carry = wp.clone(field.grad)
    launch(
        unfold_values_kernel,
        blocks.block_count,
        [values, prefix, primitives.rows, count, size, blocks.block_count],
        [carry, weights, sums],
        device,
        seconds_per_thread=BLOCK * 1e-9 * count,
    )
    if values.grad is not None:
        launch(add_values_grad_kernel, count * size, [values.grad, primitives.rows, size], [weights], device)
        pairs = count * blocks.block_count
        launch(add_gate_grad_kernel, pairs, [values, values.grad], [sums], device)
    weighted_sums(primitives, blocks, weights, sums)
    launch(add_blocks_kernel, count * SUMS, [sums, blocks.block_count], [totals], device)
    launch(
        chain_rows_kernel,
        count,
        [totals, primitives.rows, primitives.frames],
        [primitives.rows.grad],
        device,
    )
