"""The fold of the union and its reverse, block of points by block (superfrustum.md, "Union and difference").

What the backward step needs of a block lies together, so that it is in the cache: slot n, at (block * primitive_count
+ n) * BLOCK + point, is that of the n-th primitive listed there, and holds the union's derivative to the union before
it. Listed are the primitives that change the union at some point of the block: the derivative to all others is 0.
"""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

import warp as wp

from ..primitives import family
from ..primitives.family import Family
from ..rows import BLEND_C, GATE_C, ROW_C, TANGENT
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import VECTOR_OPTIONS
from ..vector_math import larger
from .combine import FAR, gated, quarter_inverse, smooth_minimum, smooth_minimum_share
from .frame import Frame, to_local
from .jacobian import TANGENT_C, JacobianRow, jacobian_row
from .points import BLOCK_C

SUMS = TANGENT + 2
"""Sums a block keeps of each primitive: its Jacobian's columns, blend and gate."""
SUMS_C = wp.constant(SUMS)
BLEND_SUM_C, GATE_SUM_C = wp.constant(TANGENT), wp.constant(TANGENT + 1)


@cached_kernel
def fold_kernels(name: str) -> tuple[wp.Kernel, wp.Kernel]:
    """The kernels that fold the union on over a run of the family `name`, and that undo this: a module of both."""
    module = f"resfit.kernels.field.adjoint_kernels.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    return _fold_kernel(family(name), module), _unfold_kernel(family(name), module)


def _fold_kernel(entry: Family, module: str) -> wp.Kernel:
    """The kernel that evaluates a run of primitives and folds the union on over them.

    A block whose points all lie outside the slow zone takes the cheaper form of the field.
    """
    table = entry.table
    sdf = entry.sdf
    fast = entry.fast or entry.sdf
    has_seam_zone = entry.seam_zone is not None
    seam_zone = entry.seam_zone or entry.sdf

    @wp.kernel(module=module)
    def fold_values_kernel(
        first: int,
        x: wp.array[float],
        y: wp.array[float],
        z: wp.array[float],
        frames: wp.array[Frame],
        tables: wp.array[table],
        rows: wp.array[float],
        primitive_count: int,
        run: wp.vec2i,
        list_all: int,
        # outputs
        out_values: wp.array[float],
        out_shares: wp.array[float],
        out_field: wp.array[float],
        out_ids: wp.array[int],
        out_counts: wp.array[int],
    ):
        block = first + wp.tid()
        base = block * BLOCK_C
        n = int(0)
        if run[0] == 0:
            for j in range(BLOCK_C):
                out_field[base + j] = FAR
        else:
            n = out_counts[block]
        for k in range(run[0], run[1]):
            slot = block * primitive_count + n
            at = slot * BLOCK_C
            # One slot a block is room enough for distances that nobody asks for.
            value_at = wp.where(list_all != 0, at, base)
            f = frames[k]
            s = tables[k]
            slow = float(0.0)
            if wp.static(has_seam_zone):
                for j in range(BLOCK_C):
                    px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                    slow += larger(seam_zone(s, px, py, pz), 0.0)
            if slow > 0.0:
                for j in range(BLOCK_C):
                    px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                    out_values[value_at + j] = sdf(s, px, py, pz)
            else:
                for j in range(BLOCK_C):
                    px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                    out_values[value_at + j] = fast(s, px, py, pz)
            blend = rows[k * ROW_C + BLEND_C]
            gate = rows[k * ROW_C + GATE_C]
            quarter = quarter_inverse(blend)
            # A loop of its own: together with the evaluation it writes too many arrays, and is slower by a fifth.
            # A sum of what is never negative is 0 only if all is. Sums become vector code where comparisons may not.
            changed = float(0.0)
            for j in range(BLOCK_C):
                before = out_field[base + j]
                value = gated(out_values[value_at + j], gate)
                share = smooth_minimum_share(before, value, quarter)
                changed += 1.0 - share
                out_shares[at + j] = share
                out_field[base + j] = smooth_minimum(before, value, blend, quarter)
            if changed > 0.0 or list_all != 0:
                out_ids[slot] = k
                n += 1
        out_counts[block] = n

    return fold_values_kernel


def _unfold_kernel(entry: Family, module: str) -> wp.Kernel:
    """The kernel that undoes the fold over a run of primitives, the last one first, and sums the derivatives.

    Primitives that get no weight at any point of a block are not evaluated there again: their sums are exactly 0.
    """
    table = entry.table
    sdf_grad = entry.sdf_grad
    fast_grad = entry.fast_grad or entry.sdf_grad
    has_seam_zone = entry.seam_zone is not None
    seam_zone = entry.seam_zone or entry.sdf

    @wp.kernel(module=module)
    def unfold_values_kernel(
        first: int,
        x: wp.array[float],
        y: wp.array[float],
        z: wp.array[float],
        frames: wp.array[Frame],
        tables: wp.array[table],
        rows: wp.array[float],
        primitive_count: int,
        run: wp.vec2i,
        shares: wp.array[float],
        ids: wp.array[int],
        counts: wp.array[int],
        asked: wp.array[float],
        asked_stride: int,
        # outputs
        carry: wp.array[float],
        passed: wp.array[float],
        out_sums: wp.array[float],
    ):
        block = first + wp.tid()
        base = block * BLOCK_C
        for back in range(counts[block]):
            slot = block * primitive_count + counts[block] - 1 - back
            k = ids[slot]
            if k >= run[0] and k < run[1]:
                at = slot * BLOCK_C
                asked_at = at * asked_stride
                blend_sum = float(0.0)
                heavy = float(0.0)
                for j in range(BLOCK_C):
                    share = shares[at + j]
                    whole = carry[base + j]
                    through = whole * (1.0 - share)
                    weight = through + asked[asked_at + j]
                    blend_sum += -through * share
                    heavy += wp.abs(weight)
                    passed[base + j] = weight
                    carry[base + j] = whole * share
                gate_sum = float(0.0)
                total = JacobianRow()
                # Written so that a weight that is no number is not lost.
                if heavy != 0.0:
                    f = frames[k]
                    s = tables[k]
                    slow = float(0.0)
                    if wp.static(has_seam_zone):
                        for j in range(BLOCK_C):
                            px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                            slow += larger(seam_zone(s, px, py, pz), 0.0)
                    if slow > 0.0:
                        for j in range(BLOCK_C):
                            px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                            d = sdf_grad(s, px, py, pz)
                            weight = passed[base + j]
                            gate_sum += weight * (d[0] - 1.0)
                            row = jacobian_row(px, py, pz, d)
                            for m in range(TANGENT_C):
                                total[m] += weight * row[m]
                    else:
                        for j in range(BLOCK_C):
                            px, py, pz = to_local(f, x[base + j], y[base + j], z[base + j])
                            d = fast_grad(s, px, py, pz)
                            weight = passed[base + j]
                            gate_sum += weight * (d[0] - 1.0)
                            row = jacobian_row(px, py, pz, d)
                            for m in range(TANGENT_C):
                                total[m] += weight * row[m]
                store = slot * SUMS_C
                gate = rows[k * ROW_C + GATE_C]
                for m in range(TANGENT_C):
                    out_sums[store + m] = gate * total[m]
                out_sums[store + BLEND_SUM_C] = blend_sum
                out_sums[store + GATE_SUM_C] = gate_sum

    return unfold_values_kernel
