"""One primitive over a block of points: the functions that all kernels which evaluate fields share, and their launches.

A block whose points all lie outside the family's seam zone takes the cheaper form of the field.
"""

# No postponed annotations here: Warp reads the functions' own, which name a family's table.

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import warp as wp

from ..primitives import family
from ..rows import DERIVATIVES
from ..runtime.cached_kernel import cached_kernel
from ..runtime.launch import launch
from ..vector_math import larger
from .frame import Frame, to_local
from .points import BLOCK, Points, at
from .primitive_set import PrimitiveSet, Run

BlockFloats = wp.types.vector(length=BLOCK, dtype=float)
"""One number for each point of a block, in a thread's own memory: of arrays the compiler has to check at every loop
whether they overlap."""
BlockIntegers = wp.types.vector(length=BLOCK, dtype=int)


@wp.func
def local_point(p: Points, i: int, f: Frame):
    """Point `i` in the frame of a primitive."""
    return to_local(f, at(p.x, i), at(p.y, i), at(p.z, i))


class BlockFunctions(NamedTuple):
    """Warp functions of a family: (points, number of the block's first point, frame, table) -> ..."""

    distances: Any
    """BlockFloats, signed distances, negative inside."""
    derivatives: Any
    """Matrix (rows, size): distances, and their derivatives in the order of `Derivatives`."""


@cached_kernel
def block_functions(name: str, size: int = BLOCK, rows: int = DERIVATIVES) -> BlockFunctions:
    """Functions of the family `name` for `size` neighbouring points at a time.

    The matrix of derivatives has room for `rows`: fewer where not all are needed, more where others follow them.
    """
    module = f"resfit.kernels.block.{name}.{size}.{rows}"
    entry = family(name)
    table, sdf, sdf_grad = entry.table, entry.sdf, entry.sdf_grad
    fast, fast_grad = entry.fast or entry.sdf, entry.fast_grad or entry.sdf_grad
    has_seam_zone = entry.seam_zone is not None
    seam_zone = entry.seam_zone or entry.sdf
    size_c, filled_c = wp.constant(size), wp.constant(min(rows, DERIVATIVES))
    vector = BlockFloats if size == BLOCK else wp.types.vector(length=size, dtype=float)
    matrix = wp.types.matrix(shape=(rows, size), dtype=float)

    @wp.func(module=module)
    def block_is_slow(p: Points, base: int, f: Frame, s: table) -> bool:
        # A sum of what is never negative is 0 only if all is. Sums become vector code where comparisons may not.
        slow = float(0.0)
        if wp.static(has_seam_zone):
            for j in range(size_c):
                x, y, z = local_point(p, base + j, f)
                slow += larger(seam_zone(s, x, y, z), 0.0)
        return slow > 0.0

    @wp.func(module=module)
    def block_distances(p: Points, base: int, f: Frame, s: table, out: wp.ref[vector]):
        if block_is_slow(p, base, f, s):
            for j in range(size_c):
                x, y, z = local_point(p, base + j, f)
                out[j] = sdf(s, x, y, z)
        else:
            for j in range(size_c):
                x, y, z = local_point(p, base + j, f)
                out[j] = fast(s, x, y, z)

    @wp.func(module=module)
    def block_derivatives(p: Points, base: int, f: Frame, s: table, out: wp.ref[matrix]):
        if block_is_slow(p, base, f, s):
            for j in range(size_c):
                x, y, z = local_point(p, base + j, f)
                d = sdf_grad(s, x, y, z)
                for m in range(filled_c):
                    out[m, j] = d[m]
        else:
            for j in range(size_c):
                x, y, z = local_point(p, base + j, f)
                d = fast_grad(s, x, y, z)
                for m in range(filled_c):
                    out[m, j] = d[m]

    return BlockFunctions(block_distances, block_derivatives)


def launch_runs(
    make_kernel: Callable[[str], wp.Kernel],
    primitives: PrimitiveSet,
    count: int | Callable[[], int],
    inputs: Sequence[Any],
    outputs: Sequence[Any],
    seconds_per_primitive: float,
    runs: Iterable[Run] | None = None,
) -> None:
    """Launch a family's kernel for every run of primitives of that family, in order.

    The kernel's first arguments are `first: int, primitives: Primitives, tables: wp.array[table]`.

    Args:
        make_kernel: from a family's name.
        primitives: the assembly.
        count: threads of each launch, most often one for each block of points.
        inputs, outputs: the other arguments.
        seconds_per_primitive: a guess of a thread's time on one core for one primitive.
        runs: all, in order, unless given.
    """
    for run in primitives.runs if runs is None else runs:
        launch(
            make_kernel(run.family.name),
            count,
            [primitives.arguments(run), primitives.tables[run.family.name], *inputs],
            outputs,
            primitives.device,
            seconds_per_thread=seconds_per_primitive * run.count,
        )


def launch_pairs(
    make_kernel: Callable[[str], wp.Kernel],
    primitives: PrimitiveSet,
    count: int,
    inputs: Sequence[Any],
    outputs: Sequence[Any],
    seconds: float,
) -> None:
    """The same with one thread for each primitive and each of `count` blocks, primitive-major, `seconds` each."""
    for run in primitives.runs:
        launch(
            make_kernel(run.family.name),
            run.count * count,
            [primitives.arguments(run), primitives.tables[run.family.name], *inputs],
            outputs,
            primitives.device,
            seconds_per_thread=seconds,
        )
