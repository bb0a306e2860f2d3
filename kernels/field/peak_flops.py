"""Peak FLOPS of the machine: a kernel that only multiplies and adds."""

from __future__ import annotations

from collections.abc import Callable

import warp as wp

from ..runtime.launch import VECTOR_OPTIONS, launch
from .points import BLOCK, BLOCK_C

wp.set_module_options(VECTOR_OPTIONS)

CHAIN = 12
"""Multiplications and additions one after the other, in each of four chains: their latency is hidden."""
OPERATIONS = 4 * 2 * CHAIN
"""Operations of a value, the last sum apart."""


@wp.kernel
def multiply_add_kernel(
    first: int,
    a: float,
    b: float,
    # outputs
    values: wp.array[float],
):
    """Chains of v = a v + b for one block of values."""
    base = (first + wp.tid()) * BLOCK_C
    for j in range(BLOCK_C):
        p = values[base + j]
        q = p + a
        r = p + b
        s = p - a
        for _ in range(wp.static(CHAIN)):
            p = a * p + b
            q = a * q + b
            r = a * r + b
            s = a * s + b
        values[base + j] = 0.25 * (p + q) + 0.25 * (r + s)


def multiply_add(values: wp.array) -> Callable[[], None]:
    """A function that does OPERATIONS to each of the values, whose number is a multiple of BLOCK."""
    return lambda: launch(
        multiply_add_kernel,
        values.shape[0] // BLOCK,
        [0.999, 0.001],
        [values],
        values.device,
        seconds_per_thread=2e-8,
    )
