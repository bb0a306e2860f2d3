"""Solid voxelisation of a mesh: signed crossings of grid columns; winding numbers if the mesh has holes.

Faces are drawn onto the cell columns of each axis. Walking along a column, every face crossed changes by one the
count of how often the mesh winds round the cell; inside is where the count is positive. Where an edge cuts a row of
cells is decided by numbers that depend on that edge alone, so that the faces on both of its sides agree and no
column slips between them: along every column of a closed mesh the crossings add up to zero, whatever the rounding.
A column where they do not has met a hole. If there is any, or the axes disagree anywhere, the winding number
decides everywhere: `inside_winding`. Not differentiable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..runtime.launch import PLAIN_OPTIONS, launch
from .inside_winding import wind_cells
from .mesh_query import MeshQuery

wp.set_module_options(PLAIN_OPTIONS)

POSITIVE, NEGATIVE, BROKEN = wp.constant(1), wp.constant(4), wp.constant(16)
"""Votes of an axis, added over the three: the mesh winds round the cell once or more; backwards; the column has
a hole."""

INSIDE, OUTSIDE, INVERTED = wp.constant(3), wp.constant(0), wp.constant(12)
"""Sums of votes on which all three axes agree."""

THREADS_PER_LAUNCH = 1 << 16
"""A mesh of few, large faces is drawn by several threads a face, up to about this many in all."""


@dataclass(frozen=True)
class ColumnCounts:
    """Cell counts by the columns of three axes of a grid; the rest is outside."""

    inside: int
    """Cells that all axes found inside."""
    inverted: int
    """Cells that all axes found wound backwards: many of them, and the mesh is inside out."""
    doubtful: int
    """Cells without an agreed count: 0 for closed meshes. If any, the winding number decided, for all cells."""


def classify_cells(query: MeshQuery, resolution: int) -> tuple[wp.array, ColumnCounts]:
    """Containment of each cell centre of [-1, 1]^3 in the mesh.

    Args:
        query: the mesh; faces counter-clockwise seen from outside. What lies beyond [-1, 1]^3 counts as well.
        resolution: cells along a side.

    Returns:
        (n, n, n) bool, and what the columns said.
    """
    device = query.device
    votes = wp.zeros((resolution, resolution, resolution), dtype=wp.int8, device=device)
    crossings = wp.empty(resolution**3, dtype=int, device=device)
    totals = wp.empty(resolution**2, dtype=int, device=device)
    steps = [wp.empty_like(votes) for _ in range(3)]
    for axis in range(3):
        _count_crossings(query, resolution, axis, crossings, totals)
        _add_votes(resolution, axis, crossings, totals, steps[axis], votes)
    inside = wp.empty(votes.shape, dtype=wp.bool, device=device)
    agreed = _count_votes(votes, inside)
    if agreed.doubtful:
        inside = wind_cells(query, steps)
    return inside, agreed


def apply_sign(inside: wp.array, distance: wp.array) -> None:
    """Negate `distance` in place in the cells inside."""
    launch(
        apply_sign_kernel,
        distance.size,
        [inside.flatten()],
        [distance.flatten()],
        distance.device,
        seconds_per_thread=1e-9,
    )


def _count_crossings(
    query: MeshQuery, resolution: int, axis: int, crossings: wp.array, totals: wp.array
) -> None:
    crossings.zero_()
    totals.zero_()
    strips = max(1, min(resolution, THREADS_PER_LAUNCH // query.face_count))
    # On one core whatever it costs: atomic additions are not atomic between two launches on a CPU. A few ms.
    launch(
        count_crossings_kernel,
        query.face_count * strips,
        [query.vertices, query.faces, axis, resolution, strips],
        [crossings, totals],
        query.device,
    )


def _add_votes(
    resolution: int, axis: int, crossings: wp.array, totals: wp.array, steps: wp.array, votes: wp.array
) -> None:
    # A CPU thread walks along all columns of a plane side by side, as they lie in memory; a GPU's along one.
    lanes = resolution if votes.device.is_cpu and axis < 2 else 1
    launch(
        add_votes_kernel,
        resolution**2 // lanes,
        [axis, resolution, lanes, totals, crossings],
        [steps.flatten(), votes.flatten()],
        votes.device,
        seconds_per_thread=lanes * resolution * 2e-9,
    )


def _count_votes(votes: wp.array, inside: wp.array) -> ColumnCounts:
    resolution = votes.shape[0]
    counts = wp.empty(resolution**2, dtype=wp.vec3i, device=votes.device)
    launch(
        count_votes_kernel,
        resolution**2,
        [votes.flatten(), resolution],
        [inside.flatten(), counts],
        votes.device,
        seconds_per_thread=resolution * 1e-9,
    )
    return ColumnCounts(*counts.numpy().sum(axis=0, dtype=np.int64).tolist())


@wp.func
def grid_index(axis: int, column: int, row: int, depth: int, resolution: int) -> int:
    """Flat index of the cell `depth` along `axis`, `column` along the next axis, `row` along the third."""
    if axis == 0:
        return (depth * resolution + column) * resolution + row
    if axis == 1:
        return (row * resolution + depth) * resolution + column
    return (column * resolution + row) * resolution + depth


@wp.func
def column_index(axis: int, column: int, row: int, resolution: int) -> int:
    """Index of a column: the lower of its two axes counts slower."""
    if axis == 1:
        return row * resolution + column
    return column * resolution + row


@wp.func
def project(vertex: wp.vec3, axis: int, resolution: int) -> wp.vec3:
    """(column, row, depth) of a vertex along `axis`, in cells: cell centres are whole numbers."""
    scale = 0.5 * float(resolution)
    column, row = (axis + 1) % 3, (axis + 2) % 3
    return wp.vec3(
        (vertex[column] + 1.0) * scale - 0.5,
        (vertex[row] + 1.0) * scale - 0.5,
        (vertex[axis] + 1.0) * scale - 0.5,
    )


@wp.func
def edge_at_row(low: wp.vec3, high: wp.vec3, row: float) -> wp.vec2:
    """(column, depth) at which an edge, given from its lower end, crosses a row: equal for both its faces."""
    t = (row - low[1]) / (high[1] - low[1])
    return wp.vec2(low[0] + t * (high[0] - low[0]), low[2] + t * (high[2] - low[2]))


@wp.kernel
def count_crossings_kernel(
    first: int,
    vertices: wp.array[wp.vec3],
    faces: wp.array[int],
    axis: int,
    resolution: int,
    strips: int,
    # outputs
    out_crossings: wp.array[int],
    out_totals: wp.array[int],
):
    """Add +1 to the first cell behind a face that is entered along `axis`, -1 where it is left."""
    thread = first + wp.tid()
    face = thread // strips
    a = project(vertices[faces[3 * face]], axis, resolution)
    b = project(vertices[faces[3 * face + 1]], axis, resolution)
    c = project(vertices[faces[3 * face + 2]], axis, resolution)
    # Sort by row; `turn` is -1 if that reverses the order of the corners.
    turn = wp.int32(1)
    if b[1] < a[1]:
        swap = a
        a = b
        b = swap
        turn = -turn
    if c[1] < b[1]:
        swap = b
        b = c
        c = swap
        turn = -turn
    if b[1] < a[1]:
        swap = a
        a = b
        b = swap
        turn = -turn
    lowest = wp.min(a[2], wp.min(b[2], c[2]))
    highest = wp.max(a[2], wp.max(b[2], c[2]))
    bend = int(wp.ceil(b[1]))
    end = wp.min(int(wp.ceil(c[1])), resolution)
    row = wp.max(int(wp.ceil(a[1])), 0) + (thread - face * strips)
    while row < end:
        across = edge_at_row(a, c, float(row))
        near = wp.vec2(0.0, 0.0)
        if row < bend:
            near = edge_at_row(a, b, float(row))
        else:
            near = edge_at_row(b, c, float(row))
        column_across = wp.clamp(int(wp.ceil(across[0])), 0, resolution)
        column_near = wp.clamp(int(wp.ceil(near[0])), 0, resolution)
        step = turn
        if column_near > column_across:
            step = -turn
        slope = (near[1] - across[1]) / wp.where(near[0] != across[0], near[0] - across[0], 1.0)
        for column in range(wp.min(column_across, column_near), wp.max(column_across, column_near)):
            depth = wp.clamp(across[1] + (float(column) - across[0]) * slope, lowest, highest)
            cell = wp.max(int(wp.ceil(depth)), 0)
            wp.atomic_add(out_totals, column_index(axis, column, row, resolution), step)
            if cell < resolution:
                wp.atomic_add(out_crossings, grid_index(axis, column, row, cell, resolution), step)
        row += strips


@wp.kernel
def add_votes_kernel(
    first: int,
    axis: int,
    resolution: int,
    lanes: int,
    totals: wp.array[int],
    # outputs
    out_crossings: wp.array[int],
    out_steps: wp.array[wp.int8],
    out_votes: wp.array[wp.int8],
):
    """Sum the crossings along `lanes` neighbouring columns, in place, keep a copy, and add what they say."""
    thread = first + wp.tid()
    column = thread * lanes
    start = column
    stride = resolution * resolution
    if axis == 1:
        start = (column // resolution) * stride + column % resolution
        stride = resolution
    elif axis == 2:
        start = column * resolution
        stride = 1
    for depth in range(resolution):
        for j in range(lanes):
            i = start + depth * stride + j
            count = out_crossings[i]
            out_steps[i] = wp.int8(count)
            if depth > 0:
                count += out_crossings[i - stride]
                out_crossings[i] = count
            vote = wp.where(count > 0, POSITIVE, wp.where(count < 0, NEGATIVE, 0))
            if totals[column + j] != 0:
                vote = BROKEN
            out_votes[i] = wp.int8(int(out_votes[i]) + vote)


@wp.kernel
def count_votes_kernel(
    first: int,
    votes: wp.array[wp.int8],
    resolution: int,
    # outputs
    out_inside: wp.array[wp.bool],
    out_counts: wp.array[wp.vec3i],
):
    """Inside, inverted and doubtful cells of one row along z."""
    row = first + wp.tid()
    inside = wp.int32(0)
    inverted = wp.int32(0)
    doubtful = wp.int32(0)
    for j in range(resolution):
        i = row * resolution + j
        vote = int(votes[i])
        out_inside[i] = vote == INSIDE
        if vote == INSIDE:
            inside += 1
        elif vote == INVERTED:
            inverted += 1
        elif vote != OUTSIDE:
            doubtful += 1
    out_counts[row] = wp.vec3i(inside, inverted, doubtful)


@wp.kernel
def apply_sign_kernel(
    first: int,
    inside: wp.array[wp.bool],
    # outputs
    out_distance: wp.array[float],
):
    i = first + wp.tid()
    if inside[i]:
        out_distance[i] = -out_distance[i]
