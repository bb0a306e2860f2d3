"""The rows that points ask for, sorted by primitive into padded blocks: a counting sort on the device.

Rows are counted a block of points and a primitive at a time (`residual_points`), the counts are summed up along the
blocks, and each block then writes its rows from where those before it end. The order is fixed: primitive, block, point.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..field.points import BLOCK, BLOCK_C
from ..runtime.launch import PLAIN_OPTIONS, launch
from .nearest_primitives import NearestPrimitives
from .point_batches import OWNER_BLOCK, OWNER_BLOCK_C, PointBatches
from .residual_points import RESIDUAL_COUNT_C, Contributions, ResidualPoints
from .residuals import RESIDUAL_COUNT, RESIDUALS, ResidualWeights

wp.set_module_options(PLAIN_OPTIONS)

EMPTY = wp.constant(1.0e30)
"""Target distance of a row that wants its primitive elsewhere."""


@wp.struct
class RowSource:
    """Everything that rows are made of, (n,) with padding: points, what is wanted there, and the union's owners."""

    x: wp.array[float]
    y: wp.array[float]
    z: wp.array[float]
    distance: wp.array[float]
    root_weight: wp.array[float]
    field: wp.array[float]
    owner: wp.array[int]
    nearest: wp.array[float]
    second: wp.array[int]
    runner_up: wp.array[float]
    share: wp.array[float]
    kind: wp.array[int]
    live: wp.array[int]


@wp.struct
class RowSink:
    """Columns of sorted rows, as in `PointBatches`."""

    x: wp.array[float]
    y: wp.array[float]
    z: wp.array[float]
    target: wp.array[float]
    weight: wp.array[float]
    offset: wp.array[float]
    slope: wp.array[float]
    widening: wp.array[float]


def _source(points: ResidualPoints, owners: NearestPrimitives, found: Contributions) -> RowSource:
    source, blocks = RowSource(), points.blocks
    source.x, source.y, source.z = blocks.x, blocks.y, blocks.z
    source.distance, source.root_weight = points.distance, points.root_weight
    source.field, source.owner, source.nearest = owners.field, owners.owner, owners.nearest
    source.second, source.runner_up, source.share = owners.second, owners.runner_up, owners.share
    source.kind, source.live = found.kind, owners.live
    return source


class RowSorter:
    """The sorted rows of some points, made anew at every step in arrays of fixed size.

    Args:
        primitive_count: of the assembly.
        points: of the loss.
        owners: filled by `find_owners` before each `sort`.
        found: filled by `weigh_points` before each `sort`.
        weights: of the RESIDUALS.
    """

    def __init__(
        self,
        primitive_count: int,
        points: ResidualPoints,
        owners: NearestPrimitives,
        found: Contributions,
        weights: Sequence[float],
    ):
        self.device, self.blocks = points.blocks.device, points.blocks.block_count
        self.counts = found.counts
        self.root_weights = ResidualWeights(*(weight**0.5 for weight in weights))
        most = RESIDUAL_COUNT * points.blocks.x.shape[0] // OWNER_BLOCK + 1 + primitive_count
        self.totals = wp.empty(primitive_count, dtype=int, device=self.device)
        self.source = _source(points, owners, found)
        # Padding keeps what earlier steps wrote there: it must be finite from the start.
        columns = [wp.zeros(most * OWNER_BLOCK, dtype=float, device=self.device) for _ in range(8)]
        self.sink = sink = RowSink()
        sink.x, sink.y, sink.z, sink.target = columns[:4]
        sink.weight, sink.offset, sink.slope, sink.widening = columns[4:]
        self.rows = PointBatches(
            *columns,
            owners=wp.empty(most, dtype=int, device=self.device),
            point_blocks=wp.array(range(most), dtype=int, device=self.device),
            first_block=wp.empty(primitive_count + 1, dtype=int, device=self.device),
            pair_count=most,
        )
        self.first_block = self.rows.first_block.numpy() if self.device.is_cpu else np.zeros(1, int)

    def block_count(self) -> int:
        """Blocks of rows: those in use on the CPU, where asking for their number is free, else all."""
        return int(self.first_block[-1]) if self.device.is_cpu else self.rows.pair_count

    def sort(self) -> None:
        """Fill `rows`; counts become places."""
        count, rows = self.totals.shape[0], self.rows
        launch(sum_counts_kernel, count, [self.blocks], [self.counts, self.totals], self.device)
        launch(
            place_blocks_kernel,
            count,
            [self.totals, count, rows.pair_count],
            [rows.first_block, rows.owners, rows.weight],
            self.device,
        )
        launch(
            write_rows_kernel,
            self.blocks,
            [self.source, rows.first_block, self.root_weights, self.blocks],
            [self.counts, self.sink],
            self.device,
            seconds_per_thread=BLOCK * 6e-9,
        )


@wp.kernel
def sum_counts_kernel(
    first: int,
    block_count: int,
    # outputs
    counts: wp.array[int],
    out_totals: wp.array[int],
):
    """Rows of one primitive before each block, in place of those in it, and all of them."""
    k = first + wp.tid()
    total = int(0)
    for block in range(block_count):
        here = counts[k * block_count + block]
        counts[k * block_count + block] = total
        total += here
    out_totals[k] = total


@wp.kernel
def place_blocks_kernel(
    first: int,
    totals: wp.array[int],
    primitive_count: int,
    most: int,
    # outputs
    out_first_block: wp.array[int],
    out_owners: wp.array[int],
    out_weight: wp.array[float],
):
    """Give one primitive its blocks of rows: whose they are, and weight 0 in the padding."""
    k = first + wp.tid()
    begin = int(0)
    for other in range(k):
        begin += (totals[other] + OWNER_BLOCK_C - 1) / OWNER_BLOCK_C
    end = begin + (totals[k] + OWNER_BLOCK_C - 1) / OWNER_BLOCK_C
    out_first_block[k] = begin
    for block in range(begin, end):
        out_owners[block] = k
    for row in range(begin * OWNER_BLOCK_C + totals[k], end * OWNER_BLOCK_C):
        out_weight[row] = 0.0
    if k == primitive_count - 1:
        out_first_block[primitive_count] = end
        for block in range(end, most):
            out_owners[block] = -1


@wp.func
def write_point_rows(
    source: RowSource,
    i: int,
    block: int,
    block_count: int,
    first_block: wp.array[int],
    root_weights: ResidualWeights,
    # outputs
    places: wp.array[int],
    out: RowSink,
):
    """Write the rows of one point, in the order of the RESIDUALS."""
    bits = source.kind[i]
    for n in range(RESIDUAL_COUNT_C):
        if (bits & (1 << n)) != 0:
            k = source.owner[i]
            offset = source.field[i] - source.nearest[i]
            slope = source.share[i]
            # Of the two that blend, the later one's radius counts.
            other = source.second[i]
            widening = -slope * (1.0 - slope)
            target = source.distance[i]
            if wp.static(RESIDUALS[n].of_second):
                other = k
                k = source.second[i]
                offset = source.field[i] - source.runner_up[i]
                slope = 1.0 - slope
            if wp.static(RESIDUALS[n].empties):
                offset = 0.0
                slope = 1.0
                widening = 0.0
                target = EMPTY
            at = k * block_count + block
            place = first_block[k] * OWNER_BLOCK_C + places[at]
            places[at] = places[at] + 1
            out.x[place] = source.x[i]
            out.y[place] = source.y[i]
            out.z[place] = source.z[i]
            out.target[place] = target
            out.weight[place] = source.root_weight[i] * root_weights[n]
            out.offset[place] = offset
            out.slope[place] = slope
            out.widening[place] = wp.where(k > other, widening, 0.0)


@wp.kernel
def write_rows_kernel(
    first: int,
    source: RowSource,
    first_block: wp.array[int],
    root_weights: ResidualWeights,
    block_count: int,
    # outputs
    places: wp.array[int],
    out: RowSink,
):
    """Write the rows of one block of points to their primitives' blocks."""
    block = first + wp.tid()
    if source.live[block] == 0:
        return
    for j in range(BLOCK_C):
        i = block * BLOCK_C + j
        write_point_rows(source, i, block, block_count, first_block, root_weights, places, out)
