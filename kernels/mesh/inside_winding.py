"""Inside or outside by winding numbers, for the cells of a grid and a mesh that does not close.

Across a face the winding number jumps by one, and the crossings of columns tell where; but for these jumps it is
harmonic, hence smooth, away from the edges of the holes. So one winding number decides a whole block of cells: the
other cells differ from it by the faces crossed on the way, and by little else if no hole's edge is near. Blocks
near such edges are split, down to single cells. Where the edges are shows in the crossings too: around a square of
four cells they add up to zero unless an edge passes through it. Not differentiable.
"""

from __future__ import annotations

import warp as wp

from ..grid.block_list import all_blocks, flat_nonzero, split_blocks, unpack_cell
from ..grid.distance_grid import nearest_true_cells
from ..runtime.launch import PLAIN_OPTIONS, launch
from .mesh_query import WINDING_ACCURACY, MeshQuery, winding_number

wp.set_module_options(PLAIN_OPTIONS)

BLOCK_SIZE = 8
"""Cells along the largest block that one winding number may decide."""

EDGE_SLACK = wp.constant(1.5)
"""Cells by which an edge may be nearer than the corner of the square in which it showed."""

CHANGE_BY_SHARE = wp.constant(0.4)
"""Most that the winding number, less its jumps, changes over a given share of the distance to the nearest edge.
Beside a straight edge it is 1 / (2 pi), at a crack's two edges twice that; the bound for any function of the kind
is 3 / 4. Tested on meshes with holes, loose triangles and turned faces: no cell comes out otherwise."""

LARGEST_SHARE = wp.constant(0.7)
"""Blocks reach no further towards the nearest edge than this."""

WINDING_ERROR = wp.constant(0.02)
"""Margin for the dipoles that stand for distant parts of the mesh."""


def wind_cells(query: MeshQuery, steps: list[wp.array]) -> wp.array:
    """Winding-number test of each cell centre of [-1, 1]^3: true above 1/2.

    Args:
        query: the mesh.
        steps: for each axis (n, n, n) int8, the signed crossings between a cell and the one before it.

    Returns:
        (n, n, n) bool.
    """
    device = query.device
    shape = steps[0].shape
    resolution = shape[0]
    inside = wp.empty(shape, dtype=wp.bool, device=device)
    flat_steps = [step.flatten() for step in steps]
    edges = wp.empty(shape, dtype=wp.bool, device=device)
    launch(
        mark_edges_kernel,
        edges.size,
        [*flat_steps, resolution],
        [edges.flatten()],
        device,
        seconds_per_thread=4e-9,
    )
    nearest_edge = nearest_true_cells(edges)
    size = BLOCK_SIZE
    blocks = all_blocks(resolution, size, device)
    while len(blocks):
        undecided = wp.empty(len(blocks), dtype=int, device=device)
        launch(
            decide_blocks_kernel,
            len(blocks),
            [query.mesh.id, blocks, *flat_steps, nearest_edge.flatten(), resolution, size, WINDING_ACCURACY],
            [inside.flatten(), undecided],
            device,
            seconds_per_thread=4e-6,
        )
        size //= 2
        blocks = split_blocks(blocks, flat_nonzero(undecided))
    return inside


@wp.kernel
def mark_edges_kernel(
    first: int,
    steps_x: wp.array[wp.int8],
    steps_y: wp.array[wp.int8],
    steps_z: wp.array[wp.int8],
    resolution: int,
    # outputs
    out_edges: wp.array[wp.bool],
):
    """Mark a cell if the crossings around one of the three squares that end in it do not cancel."""
    i = first + wp.tid()
    row = i // resolution
    x = row // resolution
    y = row - x * resolution
    z = i - row * resolution
    a = resolution * resolution
    b = resolution
    edge = wp.bool(False)
    if x > 0 and y > 0:
        edge = int(steps_x[i - b]) + int(steps_y[i]) != int(steps_y[i - a]) + int(steps_x[i])
    if x > 0 and z > 0:
        edge = edge or int(steps_x[i - 1]) + int(steps_z[i]) != int(steps_z[i - a]) + int(steps_x[i])
    if y > 0 and z > 0:
        edge = edge or int(steps_y[i - 1]) + int(steps_z[i]) != int(steps_z[i - b]) + int(steps_y[i])
    out_edges[i] = edge


@wp.func
def walk(steps: wp.array[wp.int8], start: int, stride: int, count: int) -> int:
    """Signed crossings on the way from cell `start` over `count` cells, backwards if that is negative."""
    total = wp.int32(0)
    for k in range(count):
        total += int(steps[start + (k + 1) * stride])
    for k in range(-count):
        total -= int(steps[start - k * stride])
    return total


@wp.func
def edge_clearance(middle: wp.vec3i, nearest: int) -> float:
    """Cells from a cell's centre within which there is no edge of a hole."""
    if nearest < 0:
        return 1.0e6
    offset = unpack_cell(nearest) - middle
    return wp.sqrt(float(wp.dot(offset, offset))) - EDGE_SLACK


@wp.kernel
def decide_blocks_kernel(
    first: int,
    mesh: wp.uint64,
    blocks: wp.array[int],
    steps_x: wp.array[wp.int8],
    steps_y: wp.array[wp.int8],
    steps_z: wp.array[wp.int8],
    nearest_edge: wp.array[int],
    resolution: int,
    size: int,
    accuracy: float,
    # outputs
    out_inside: wp.array[wp.bool],
    out_undecided: wp.array[int],
):
    """Settle the cells of a block by one winding number, or leave the block to its eighths."""
    thread = first + wp.tid()
    out_undecided[thread] = 0
    low = unpack_cell(blocks[thread]) * size
    last = wp.vec3i(resolution - 1, resolution - 1, resolution - 1)
    high = wp.min(low + wp.vec3i(size - 1, size - 1, size - 1), last)
    if low[0] > high[0] or low[1] > high[1] or low[2] > high[2]:
        return
    middle = wp.min(low + wp.vec3i(size // 2, size // 2, size // 2), last)
    centre = (middle[0] * resolution + middle[1]) * resolution + middle[2]
    doubt = wp.float32(0.0)
    if size > 1:
        radius = 1.7321 * float(size // 2)
        share = radius / wp.max(edge_clearance(middle, nearest_edge[centre]), 1.0e-3)
        doubt = CHANGE_BY_SHARE * share + WINDING_ERROR
        if share > LARGEST_SHARE:
            out_undecided[thread] = 1
            return
    spacing = 2.0 / float(resolution)
    point = wp.vec3(
        (float(middle[0]) + 0.5) * spacing - 1.0,
        (float(middle[1]) + 0.5) * spacing - 1.0,
        (float(middle[2]) + 0.5) * spacing - 1.0,
    )
    winding = winding_number(mesh, point, accuracy)
    # Every value that a cell here can have is this one and a whole number: all are clear of 1/2, or none is.
    if size > 1 and wp.abs(winding - wp.floor(winding) - 0.5) < doubt:
        out_undecided[thread] = 1
        return
    for x in range(low[0], high[0] + 1):
        count_x = walk(steps_x, centre, resolution * resolution, x - middle[0])
        start_x = centre + (x - middle[0]) * resolution * resolution
        for y in range(low[1], high[1] + 1):
            count_y = count_x + walk(steps_y, start_x, resolution, y - middle[1])
            start_y = start_x + (y - middle[1]) * resolution
            for z in range(low[2], high[2] + 1):
                count = count_y + walk(steps_z, start_y, 1, z - middle[2])
                out_inside[start_y + z - middle[2]] = winding + float(count) > 0.5
