"""Scaling of the union with primitives and points, dense and culled, and its share of the machine's peak.

The peak is measured here too, by a kernel that does nothing but multiply and add.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from ...kernels.field.culling import cull
from ...kernels.field.evaluate import primitives_at, union_at
from ...kernels.field.peak_flops import OPERATIONS, multiply_add
from ...kernels.field.points import PointBlocks
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.rows import BLEND, SHAPES
from .harness import Workload, measure, scene_points, scene_rows

COUNTS = (2, 8, 32, 64, 128, 256)
SIZES = (1_000, 10_000, 100_000, 1_000_000)
MOST = 64_000_000
"""Evaluations of a dense run; larger ones are left out."""

SMALLEST, LARGEST = 0.03, 0.25
"""Half sizes of the primitives: small ones, as in an assembly, so that culling has something to cull."""

DISTANCE_OPERATIONS = 147
"""Arithmetic operations of a SuperFrustum's distance outside its slow zone with the change to its frame, as counted in
the code that Warp generates: both sides of every branch, which is what vector code computes."""


@dataclass(frozen=True)
class ScalingRow:
    """One scene. Times are medians in milliseconds, on one core in CPU time and on all in wall time."""

    primitives: int
    points: int
    dense_one_core_ms: float | None
    dense_ms: float | None
    culled_one_core_ms: float
    culled_ms: float


@dataclass(frozen=True)
class PeakRow:
    """Peak throughput of one core, and cost of the field of a family."""

    peak_gflops: float
    operations: int
    """Of an evaluation."""
    ns: float
    """Nanoseconds of an evaluation, one core."""

    @property
    def share(self) -> float:
        """Of the peak, 0 to 1."""
        return self.operations / self.ns / self.peak_gflops


def _small_primitives(count: int, device: wp.Device) -> PrimitiveSet:
    """`count` SuperFrusta that fill about the same volume whatever their number."""
    rows = scene_rows("superfrustum", count)
    size = float(np.clip(0.35 * (8.0 / count) ** (1.0 / 3.0), SMALLEST, LARGEST))
    rows[:, SHAPES : SHAPES + 3] = np.random.default_rng(4).uniform(0.5 * size, 1.5 * size, (count, 3))
    rows[:, BLEND] = 0.2 * size
    return PrimitiveSet(rows, ["superfrustum"] * count, device)


def measure_scaling(
    device: wp.Device,
    counts: Sequence[int] = COUNTS,
    sizes: Sequence[int] = SIZES,
    on_row: Callable[[ScalingRow], None] | None = None,
) -> list[ScalingRow]:
    """All rows of the table.

    Args:
        device: where to measure.
        counts: of primitives.
        sizes: numbers of points.
        on_row: called with each row as it comes.
    """
    rows = []
    for row in _rows(device, counts, sizes):
        rows.append(row)
        if on_row is not None:
            on_row(row)
    return rows


def _rows(device: wp.Device, counts: Sequence[int], sizes: Sequence[int]) -> Iterator[ScalingRow]:
    for size in sizes:
        points = scene_points(size, device)
        for count in counts:
            primitives = _small_primitives(count, device)
            culled = measure(Workload("culled", "", count * size, _culled_work(primitives, points)), device)
            dense = None
            if count * size <= MOST:
                dense = measure(Workload("dense", "", count * size, _dense_work(primitives, points)), device)
            yield ScalingRow(
                count,
                size,
                dense and dense.milliseconds,
                dense and dense.all_cores_milliseconds,
                culled.milliseconds,
                culled.all_cores_milliseconds,
            )


def _culled_work(primitives: PrimitiveSet, points: PointBlocks) -> Callable[[], object]:
    """The union at all points, lists made anew each time."""
    field = wp.empty(points.x.shape[0], dtype=float, device=points.device)
    return lambda: union_at(primitives, points, lists=cull(primitives, points), out_field=field)


def _dense_work(primitives: PrimitiveSet, points: PointBlocks) -> Callable[[], object]:
    """Every primitive at every point."""
    values = wp.empty(len(primitives) * points.x.shape[0], dtype=float, device=points.device)
    return lambda: primitives_at(primitives, points, values)


def measure_peak(device: wp.Device, forward_ns: float) -> PeakRow:
    """The peak of one core, or of the GPU, beside the SuperFrustum's distance at `forward_ns` an evaluation."""
    values = wp.ones(1 << 14, dtype=float, device=device)
    work = multiply_add(values)
    row = measure(Workload("peak", "", OPERATIONS * values.shape[0], work), device)
    return PeakRow(1.0 / row.ns_per_evaluation, DISTANCE_OPERATIONS, forward_ns)


def scaling_table(rows: Sequence[ScalingRow], peak: PeakRow) -> str:
    """The rows as a section of a Markdown page, one line for each number of points, and the share of the peak."""
    counts = list(dict.fromkeys(row.primitives for row in rows))
    lines = [
        "",
        "## Growth with primitives and points",
        "",
        "K small SuperFrusta at N points along a space-filling curve. Dense: every primitive at every point. Culled:",
        "their smooth union, blocks of points being shown only what can matter there. Milliseconds on one core.",
        "",
        f"| N | {' | '.join(f'K = {count}' for count in counts)} |",
        f"|---|{'---|' * len(counts)}",
    ]
    for size in dict.fromkeys(row.points for row in rows):
        for name in ("dense", "culled"):
            own = {row.primitives: row for row in rows if row.points == size}
            cells = [getattr(own[count], f"{name}_one_core_ms") if count in own else None for count in counts]
            shown = ["" if value is None else f"{value:.3g}" for value in cells]
            lines.append(f"| {size:,} {name} | {' | '.join(shown)} |")
    lines += [
        "",
        f"One core multiplies and adds {peak.peak_gflops:.0f} thousand million times a second at best (a fused pair",
        f"counts as two). A SuperFrustum's distance is {peak.operations} operations, most of them not fused, in",
        f"{peak.ns:.2f} ns: {100 * peak.share:.0f} % of that.",
    ]
    return "\n".join(lines) + "\n"
