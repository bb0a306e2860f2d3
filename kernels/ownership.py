"""Who answers for a point: the nearest primitive, the runner-up, and their shares in the union."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from .launch import VECTOR_OPTIONS, launch
from .points import BLOCK, BLOCK_C, PointBlocks
from .primitive_set import PrimitiveSet
from .rows import BLEND_C, GATE_C, ROW_C
from .union import FAR, gated, quarter_inverse, smooth_minimum
from .vector_math import larger, smaller

wp.set_module_options(VECTOR_OPTIONS)


@dataclass(frozen=True)
class Ownership:
    """What the union looks like at each point; distances are float32, normalised units, negative inside."""

    union: np.ndarray
    """(n,) smooth union."""
    owner: np.ndarray
    """(n,) int32, the primitive with the smallest distance."""
    nearest: np.ndarray
    """(n,) that distance."""
    second: np.ndarray
    """(n,) int32, the primitive with the second smallest distance; 0 where there is only one primitive."""
    runner_up: np.ndarray
    """(n,) that distance, FAR where there is only one primitive."""
    share: np.ndarray
    """(n,) in [1/2, 1]: derivative of the union to the owner, as far as these two go; the second has the rest."""


@wp.kernel
def find_owners_kernel(
    first: int,
    values: wp.array[float],
    rows: wp.array[float],
    primitive_count: int,
    size: int,
    # outputs
    out_union: wp.array[float],
    out_owner: wp.array[int],
    out_nearest: wp.array[float],
    out_second: wp.array[int],
    out_runner_up: wp.array[float],
    out_share: wp.array[float],
):
    """Fold one block of points over all primitives, keeping the two smallest distances and whose they are.

    `out_share` holds the blend radius of the later of the two until the end.
    """
    base = (first + wp.tid()) * BLOCK_C
    for j in range(BLOCK_C):
        out_union[base + j] = FAR
        out_nearest[base + j] = FAR
        out_runner_up[base + j] = FAR
        out_owner[base + j] = 0
        out_second[base + j] = 0
        out_share[base + j] = 0.0
    for k in range(primitive_count):
        blend = rows[k * ROW_C + BLEND_C]
        gate = rows[k * ROW_C + GATE_C]
        quarter = quarter_inverse(blend)
        at = k * size + base
        for j in range(BLOCK_C):
            out_union[base + j] = smooth_minimum(
                out_union[base + j], gated(values[at + j], gate), blend, quarter
            )
        for j in range(BLOCK_C):
            value = gated(values[at + j], gate)
            nearest = out_nearest[base + j]
            runner_up = out_runner_up[base + j]
            leads = value < nearest
            follows = value < runner_up
            # As k counts up, the later of the two nearest is k whenever k is one of them.
            out_share[base + j] = wp.where(follows, blend, out_share[base + j])
            out_runner_up[base + j] = smaller(runner_up, larger(value, nearest))
            out_nearest[base + j] = smaller(nearest, value)
            owner = out_owner[base + j]
            out_second[base + j] = wp.where(leads, owner, wp.where(follows, k, out_second[base + j]))
            out_owner[base + j] = wp.where(leads, k, owner)
    for j in range(BLOCK_C):
        gap = out_runner_up[base + j] - out_nearest[base + j]
        share = 0.5 + 0.5 * gap / larger(out_share[base + j], 1.0e-9)
        out_share[base + j] = smaller(share, 1.0)


def ownership_arrays(blocks: PointBlocks) -> tuple[wp.array, ...]:
    """Outputs of `find_owners` for points that are looked at often."""
    size = max(1, blocks.x.shape[0])
    kinds = (float, int, float, int, float, float)
    return tuple(wp.empty(size, dtype=kind, device=blocks.device) for kind in kinds)


def find_owners(
    primitives: PrimitiveSet, blocks: PointBlocks, values: wp.array, out: tuple[wp.array, ...] | None = None
) -> Ownership:
    """Owners of all points.

    Args:
        primitives: the assembly, at least one primitive.
        blocks: the points.
        values: of `primitives_at` for the same points.
        out: from `ownership_arrays`; on the CPU the result then shares their memory.
    """
    out = out or ownership_arrays(blocks)
    launch(
        find_owners_kernel,
        blocks.block_count,
        [values, primitives.rows, len(primitives), blocks.x.shape[0]],
        out,
        blocks.device,
        seconds_per_thread=BLOCK * 2e-9 * len(primitives),
    )
    return Ownership(*(array.numpy()[: blocks.count] for array in out))
