"""Exact Euclidean distance transform of a 3D grid, and the nearest true cell of every cell.

Separable: along x by two running sweeps, then along y and z by the lower envelope of parabolas
(Felzenszwalb and Huttenlocher, "Distance transforms of sampled functions", 2012). What is passed on is the
nearest cell itself, so that a caller who knows where the surface is in that cell can use it. Not
differentiable.
"""

from __future__ import annotations

import warp as wp

from ..runtime.launch import VECTOR_OPTIONS, launch
from .block_list import COORDINATE_LIMIT, pack_cell, unpack_cell

wp.set_module_options(VECTOR_OPTIONS)

LANES = 32
"""Neighbouring x-lines that one CPU thread sweeps in a constant loop. Warp unrolls loops of 16 and less,
and they do not vectorise then."""

CPU_LINES = 64
"""Envelope lines of one CPU thread: they share one scratch line, which so stays in the cache. On a GPU, 1."""

NOTHING = wp.constant(-1)
"""Nearest cell of a grid without a true cell."""

FAR = wp.constant(1 << 20)
"""An x further off than any cell, for lines in which no true cell was met yet."""


def nearest_true_cells(mask: wp.array) -> wp.array:
    """For each cell the true cell nearest to it by Euclidean distance.

    Args:
        mask: (nx, ny, nz) bool, contiguous, each side 1 to 1024.

    Returns:
        (nx, ny, nz) int32, coordinates packed as by `cell_list.pack_cell`; -1 everywhere if no cell is true.
        Which of several equally near cells it is stays the same from run to run.

    Raises:
        ValueError: if `mask` is of another type or shape.
    """
    _check_mask(mask)
    device = mask.device
    nx, ny, nz = mask.shape
    plane = ny * nz
    nearest = wp.empty(mask.shape, dtype=int, device=device)
    flat_mask, flat = mask.flatten(), nearest.flatten()
    blocks = plane // LANES if device.is_cpu else 0
    launch(
        sweep_block_kernel,
        blocks,
        [flat_mask, nx, plane],
        [flat],
        device,
        seconds_per_thread=nx * LANES * 4e-10,
    )
    # What does not fill a block; on a GPU everything, since neighbouring threads then read neighbouring
    # cells.
    rest = blocks * LANES
    launch(sweep_line_kernel, plane - rest, [flat_mask, nx, plane, rest], [flat], device)
    _envelope(flat, 1, nx, nz, ny, plane, nz)
    _envelope(flat, 2, nx, ny, nz, plane, 1)
    return nearest


def distance_transform(mask: wp.array) -> wp.array:
    """Distance in cells from each cell's centre to the centre of the nearest true cell, 0 at true cells.

    Args:
        mask: (nx, ny, nz) bool, contiguous, each side 1 to 1024.

    Returns:
        (nx, ny, nz) float32 on the device of `mask`; infinity everywhere if no cell is true.

    Raises:
        ValueError: if `mask` is of another type or shape.
    """
    nearest = nearest_true_cells(mask)
    distance = wp.empty(mask.shape, dtype=float, device=mask.device)
    launch(
        measure_nearest_kernel,
        mask.size,
        [nearest.flatten(), mask.shape[1], mask.shape[2]],
        [distance.flatten()],
        mask.device,
        seconds_per_thread=2e-9,
    )
    return distance


def signed_distance_transform(inside: wp.array, spacing: float = 1.0) -> wp.array:
    """Signed distance to the boundary between inside and outside cells, negative inside.

    The boundary is taken to be half a cell from the centres on either side of it: exact for faces midway
    between cells; up to about 0.8 of a cell off a slanted or curved surface that the cells were sampled
    from.

    Args:
        inside: (nx, ny, nz) bool, contiguous, each side 1 to 1024.
        spacing: side of a cell, in the unit of the result.

    Returns:
        (nx, ny, nz) float32; +infinity everywhere if no cell is inside, -infinity if all are.

    Raises:
        ValueError: if `inside` is of another type or shape.
    """
    _check_mask(inside)
    device = inside.device
    outside = wp.empty_like(inside)
    launch(
        invert_kernel, inside.size, [inside.flatten()], [outside.flatten()], device, seconds_per_thread=1e-9
    )
    to_inside, to_outside = nearest_true_cells(inside), nearest_true_cells(outside)
    distance = wp.empty(inside.shape, dtype=float, device=device)
    launch(
        measure_signed_kernel,
        inside.size,
        [
            inside.flatten(),
            to_inside.flatten(),
            to_outside.flatten(),
            inside.shape[1],
            inside.shape[2],
            spacing,
        ],
        [distance.flatten()],
        device,
        seconds_per_thread=4e-9,
    )
    return distance


def _check_mask(mask: wp.array) -> None:
    if mask.dtype != wp.bool or mask.ndim != 3 or not mask.is_contiguous:
        raise ValueError(
            f"expected a contiguous (nx, ny, nz) array of bool, got {mask.shape} of {mask.dtype}"
        )
    if min(mask.shape) < 1 or max(mask.shape) > COORDINATE_LIMIT:
        raise ValueError(f"grid sides must be between 1 and {COORDINATE_LIMIT}, got {mask.shape}")


def _envelope(
    flat: wp.array,
    axis: int,
    outer: int,
    inner: int,
    length: int,
    outer_stride: int,
    step: int,
) -> None:
    """One pass over outer * inner lines of `length` cells, `step` apart; neighbouring lines share a
    thread."""
    device = flat.device
    inner_stride = 1 if axis == 1 else length
    lines = min(CPU_LINES, inner) if device.is_cpu else 1
    chunks = -(-inner // lines)
    threads = outer * chunks
    scratch = threads * length
    vertex, packed = wp.empty(scratch, dtype=int, device=device), wp.empty(scratch, dtype=int, device=device)
    height, start = (
        wp.empty(scratch, dtype=float, device=device),
        wp.empty(scratch, dtype=float, device=device),
    )
    geometry = wp.vec4i(length, step, outer_stride, inner_stride)
    launch(
        envelope_kernel,
        threads,
        [axis, geometry, inner, lines, vertex, packed, height, start],
        [flat],
        device,
        seconds_per_thread=lines * length * 8e-9,
    )


@wp.kernel
def sweep_block_kernel(
    first: int,
    mask: wp.array[wp.bool],
    count: int,
    plane: int,
    # outputs
    out_nearest: wp.array[int],
):
    """x of the nearest true cell on each of LANES neighbouring x-lines, +-FAR where a line has none."""
    lane = (first + wp.tid()) * LANES
    for j in range(LANES):
        out_nearest[lane + j] = wp.where(mask[lane + j], 0, -FAR)
    for x in range(1, count):
        i = x * plane + lane
        for j in range(LANES):
            out_nearest[i + j] = wp.where(mask[i + j], x, out_nearest[i - plane + j])
    for back in range(1, count):
        x = count - 1 - back
        i = x * plane + lane
        for j in range(LANES):
            # The nearest of x + 1 is the next true cell, or lies behind x and is no nearer than what x has.
            ahead = out_nearest[i + plane + j]
            behind = out_nearest[i + j]
            out_nearest[i + j] = wp.where(wp.abs(ahead - x) < x - behind, ahead, behind)


@wp.kernel
def sweep_line_kernel(
    first: int,
    mask: wp.array[wp.bool],
    count: int,
    plane: int,
    skip: int,
    # outputs
    out_nearest: wp.array[int],
):
    """`sweep_block_kernel` for one x-line a thread."""
    lane = skip + first + wp.tid()
    last = wp.int32(-FAR)
    for x in range(count):
        i = x * plane + lane
        if mask[i]:
            last = x
        out_nearest[i] = last
    for back in range(1, count):
        x = count - 1 - back
        i = x * plane + lane
        behind = out_nearest[i]
        if wp.abs(last - x) < x - behind:
            out_nearest[i] = last
        else:
            last = behind


@wp.kernel
def envelope_kernel(
    first: int,
    axis: int,
    geometry: wp.vec4i,
    inner_count: int,
    lines: int,
    vertex: wp.array[int],
    packed: wp.array[int],
    height: wp.array[float],
    start: wp.array[float],
    # outputs
    out_nearest: wp.array[int],
):
    """Find what is nearest along y (axis 1) or z (axis 2) too, on `lines` neighbouring lines.

    Before the pass along y a value is the bare x of the nearest true cell of the x-line; after it, a packed
    cell. Squared distances are whole numbers below 2^24, so that float32 compares them exactly.
    """
    thread = first + wp.tid()
    length = geometry[0]
    scratch = thread * length
    chunks = (inner_count + lines - 1) // lines
    outer = thread // chunks
    inner_first = (thread - outer * chunks) * lines
    for inner in range(inner_first, wp.min(inner_first + lines, inner_count)):
        line = outer * geometry[2] + inner * geometry[3]
        top = wp.int32(-1)
        for q in range(length):
            value = out_nearest[line + q * geometry[1]]
            if value >= 0:
                offset = outer - value
                square = offset * offset
                cell = value
                if axis == 1:
                    cell = pack_cell(value, q, inner)
                else:
                    near = unpack_cell(value)
                    square = (outer - near[0]) * (outer - near[0]) + (inner - near[1]) * (inner - near[1])
                lift = float(square + q * q)
                begin = wp.float32(-1.0e30)
                while top >= 0:
                    begin = (lift - height[scratch + top]) / float(2 * (q - vertex[scratch + top]))
                    if begin > start[scratch + top]:
                        break
                    top -= 1
                if top < 0:
                    begin = -1.0e30
                top += 1
                vertex[scratch + top] = q
                packed[scratch + top] = cell
                height[scratch + top] = lift
                start[scratch + top] = begin
        k = wp.int32(0)
        for q in range(length):
            while k < top and start[scratch + k + 1] < float(q):
                k += 1
            out_nearest[line + q * geometry[1]] = wp.where(top < 0, NOTHING, packed[scratch + k])


@wp.func
def cell_distance(i: int, packed: int, ny: int, nz: int) -> float:
    """Distance from the cell with flat index i to a packed cell; infinity if that is NOTHING."""
    row = i // nz
    x = row // ny
    near = unpack_cell(packed)
    dx = x - near[0]
    dy = row - x * ny - near[1]
    dz = i - row * nz - near[2]
    return wp.where(packed < 0, wp.inf, wp.sqrt(float(dx * dx + dy * dy + dz * dz)))


@wp.kernel
def measure_nearest_kernel(
    first: int,
    nearest: wp.array[int],
    ny: int,
    nz: int,
    # outputs
    out_distance: wp.array[float],
):
    i = first + wp.tid()
    out_distance[i] = cell_distance(i, nearest[i], ny, nz)


@wp.kernel
def measure_signed_kernel(
    first: int,
    inside: wp.array[wp.bool],
    to_inside: wp.array[int],
    to_outside: wp.array[int],
    ny: int,
    nz: int,
    spacing: float,
    # outputs
    out_distance: wp.array[float],
):
    i = first + wp.tid()
    if inside[i]:
        out_distance[i] = spacing * (0.5 - cell_distance(i, to_outside[i], ny, nz))
    else:
        out_distance[i] = spacing * (cell_distance(i, to_inside[i], ny, nz) - 0.5)


@wp.kernel
def invert_kernel(
    first: int,
    mask: wp.array[wp.bool],
    # outputs
    out_mask: wp.array[wp.bool],
):
    i = first + wp.tid()
    out_mask[i] = not mask[i]
