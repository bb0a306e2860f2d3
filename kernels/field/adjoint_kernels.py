"""The fold of the union and its reverse, block of points by block (superfrustum.md, "Union and difference").

What the backward step needs of a block lies together, so that it is in the cache: slot n, at (block * primitive_count
+ n) * BLOCK + point, is that of the n-th primitive listed there, and holds the union's derivative to the union before
it. Listed are the primitives that change the union at some point of the block: the derivative to all others is 0.
"""

# No postponed annotations here: Warp reads the kernels' own, which name a family's table.

import warp as wp

from ..primitives import family
from ..rows import BLEND_C, DERIVATIVES, DERIVATIVES_C, GATE_C, ROW_C, TANGENT, Derivatives
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import VECTOR_OPTIONS
from .block import BlockFloats, block_functions, local_point
from .combine import FAR, gated, quarter_inverse, smooth_minimum, smooth_minimum_share
from .culling import Lists
from .jacobian import TANGENT_C, JacobianRow, jacobian_row
from .points import BLOCK, BLOCK_C, Points
from .primitive_set import Primitives

SUMS = TANGENT + 2
"""Sums a block keeps of each primitive: its Jacobian's columns, blend and gate."""
SUMS_C = wp.constant(SUMS)
BLEND_SUM_C, GATE_SUM_C = wp.constant(TANGENT), wp.constant(TANGENT + 1)


@cached_kernel
def fold_kernels(name: str) -> tuple[wp.Kernel, wp.Kernel]:
    """The kernels that fold the union on over a run of the family `name`, and that undo this: a module of both."""
    module = f"resfit.kernels.field.adjoint_kernels.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    return _fold_kernel(name, module), _unfold_kernel(name, module)


def _fold_kernel(name: str, module: str) -> wp.Kernel:
    """The kernel that evaluates a run of primitives and folds the union on over them."""
    table = family(name).table
    block_distances = block_functions(name).distances

    @wp.kernel(module=module)
    def fold_values_kernel(
        first: int,
        primitives: Primitives,
        tables: wp.array[table],
        points: Points,
        list_all: int,
        # outputs
        out_values: wp.array[float],
        out_shares: wp.array[float],
        out_field: wp.array[float],
        out_ids: wp.array[int],
        out_counts: wp.array[int],
    ):
        """One block; the distances are written where all primitives are listed."""
        block = first + wp.tid()
        base = block * BLOCK_C
        distance = BlockFloats()
        n = int(0)
        if primitives.begin == 0:
            for j in range(BLOCK_C):
                out_field[base + j] = FAR
        else:
            n = out_counts[block]
        for k in range(primitives.begin, primitives.end):
            slot = block * primitives.count + n
            at = slot * BLOCK_C
            block_distances(points, base, primitives.frames[k], tables[k], distance)
            if list_all != 0:
                for j in range(BLOCK_C):
                    out_values[at + j] = distance[j]
            blend = primitives.rows[k * ROW_C + BLEND_C]
            gate = primitives.rows[k * ROW_C + GATE_C]
            quarter = quarter_inverse(blend)
            # A sum of what is never negative is 0 only if all is. Sums become vector code where comparisons may not.
            changed = float(0.0)
            for j in range(BLOCK_C):
                before = out_field[base + j]
                value = gated(distance[j], gate)
                share = smooth_minimum_share(before, value, quarter)
                changed += 1.0 - share
                out_shares[at + j] = share
                out_field[base + j] = smooth_minimum(before, value, blend, quarter)
            if changed > 0.0 or list_all != 0:
                out_ids[slot] = k
                n += 1
        out_counts[block] = n

    return fold_values_kernel


def _unfold_kernel(name: str, module: str) -> wp.Kernel:
    """The kernel that undoes the fold over a run of primitives, the last one first, and sums the derivatives.

    Primitives that get no weight at any point of a block are not evaluated there again: their sums are exactly 0.
    """
    table = family(name).table
    block_derivatives = block_functions(name).derivatives
    matrix = wp.types.matrix(shape=(DERIVATIVES, BLOCK), dtype=float)

    @wp.kernel(module=module)
    def unfold_values_kernel(
        first: int,
        primitives: Primitives,
        tables: wp.array[table],
        points: Points,
        lists: Lists,
        shares: wp.array[float],
        asked: wp.array[float],
        asked_stride: int,
        # outputs
        carry: wp.array[float],
        out_sums: wp.array[float],
    ):
        block = first + wp.tid()
        base = block * BLOCK_C
        weight = BlockFloats()
        derivatives = matrix()
        for back in range(lists.counts[block]):
            slot = block * primitives.count + lists.counts[block] - 1 - back
            k = lists.ids[slot]
            if k >= primitives.begin and k < primitives.end:
                at = slot * BLOCK_C
                asked_at = at * asked_stride
                blend_sum = float(0.0)
                heavy = float(0.0)
                for j in range(BLOCK_C):
                    share = shares[at + j]
                    whole = carry[base + j]
                    through = whole * (1.0 - share)
                    passed = through + asked[asked_at + j]
                    blend_sum += -through * share
                    heavy += wp.abs(passed)
                    weight[j] = passed
                    carry[base + j] = whole * share
                gate_sum = float(0.0)
                total = JacobianRow()
                # Written so that a weight that is no number is not lost.
                if heavy != 0.0:
                    f = primitives.frames[k]
                    block_derivatives(points, base, f, tables[k], derivatives)
                    for j in range(BLOCK_C):
                        x, y, z = local_point(points, base + j, f)
                        d = Derivatives()
                        for m in range(DERIVATIVES_C):
                            d[m] = derivatives[m, j]
                        gate_sum += weight[j] * (d[0] - 1.0)
                        row = jacobian_row(x, y, z, d)
                        for m in range(TANGENT_C):
                            total[m] += weight[j] * row[m]
                store = slot * SUMS_C
                gate = primitives.rows[k * ROW_C + GATE_C]
                for m in range(TANGENT_C):
                    out_sums[store + m] = gate * total[m]
                out_sums[store + BLEND_SUM_C] = blend_sum
                out_sums[store + GATE_SUM_C] = gate_sum

    return unfold_values_kernel
