"""The workload that the authors of the paper published for their CUDA operator, on this machine, as a table of its own.

200,000 points, 2 to 64 SuperFrusta, all of them evaluated at every point: the forward step, the backward step, and
both. Theirs takes, by default, each primitive swept along all three of its axes, a mixture that costs three evaluations
a point; with the axis known it is one. Ours learns the axis the same way, by three turned copies of each primitive
(`fitter/refine/sweep_axis.py`), so that three axes are measured as three times the primitives, folded by the union.
Points are in the order of a curve through space, as a fit keeps them, which is made once, before the steps; one line
shows what random order costs.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import warp as wp

from ...fitter.refine.sweep_axis import turned_copies
from ...kernels.field.adjoint import differentiable_union
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.rows import ROW
from .harness import Workload, measure, scene_points, scene_rows

POINTS = 200_000
COUNTS = (2, 4, 8, 16, 32, 64)
AXES = (3, 1)
STEPS = ("forward", "backward", "both")

PUBLISHED = {(3, 64, "forward"): 0.50, (3, 64, "both"): 13.4}
"""Milliseconds of the authors' operator on a B200, by sweep axes, primitives and step."""


@dataclass(frozen=True)
class StepRow:
    """One measured step. Times are medians in milliseconds."""

    axes: int
    """Sweep axes that are evaluated for each primitive."""
    primitives: int
    points: int
    order: str
    """Of the points: along a curve through space, or random."""
    step: str
    """forward, backward or both."""
    one_core_ms: float
    """CPU time of one core; on a GPU the same as `ms`."""
    ms: float
    """Wall time on all cores, or on the GPU."""
    published_ms: float | None
    """The same of the authors' operator on a B200, where they give it."""


def primitive_set(count: int, axes: int, device: wp.Device) -> PrimitiveSet:
    """`count` random SuperFrusta, or all turns of them where the three axes are asked for."""
    rows = scene_rows("superfrustum", count)
    if axes > 1:
        rows = turned_copies(rows).reshape(-1, ROW)
    return PrimitiveSet(rows, ["superfrustum"] * len(rows), device, requires_grad=True)


def steps(
    count: int, axes: int, points: int, device: wp.Device, order: str = "curve"
) -> dict[str, Callable[[], None]]:
    """Benchmark steps by name; tables are derived from the parameters in every forward step, as in a fit."""
    primitives = primitive_set(count, axes, device)
    blocks = scene_points(points, device, order)
    ones = wp.ones(blocks.x.shape[0], dtype=float, device=device)

    def forward() -> tuple[wp.Tape, wp.array]:
        primitives.derive()
        tape = wp.Tape()
        return tape, differentiable_union(primitives, blocks, tape)

    def both() -> None:
        tape, field = forward()
        tape.backward(grads={field: ones})

    recorded, result = forward()
    return {
        "forward": lambda: forward() and None,
        "backward": lambda: recorded.backward(grads={result: ones}),
        "both": both,
    }


def measure_steps(
    device: wp.Device,
    counts: Sequence[int] = COUNTS,
    points: int = POINTS,
    on_row: Callable[[StepRow], None] | None = None,
) -> list[StepRow]:
    """All rows of the table.

    Args:
        device: where to measure.
        counts: of primitives.
        points: how many.
        on_row: called with each row as it comes.
    """
    rows = []
    for row in _rows(device, counts, points):
        rows.append(row)
        if on_row is not None:
            on_row(row)
    return rows


def _rows(device: wp.Device, counts: Sequence[int], points: int) -> Iterator[StepRow]:
    cases = [(axes, count, "curve") for axes in AXES for count in counts]
    for axes, count, order in [*cases, (AXES[-1], counts[-1], "random")]:
        for step, work in steps(count, axes, points, device, order).items():
            found = measure(Workload(step, step, axes * count * points, work), device)
            published = PUBLISHED.get((axes, count, step)) if points == POINTS else None
            yield StepRow(
                axes,
                count,
                points,
                order,
                step,
                found.milliseconds,
                found.all_cores_milliseconds,
                published,
            )


def say_row(row: StepRow) -> None:
    """One line on stderr."""
    sys.stderr.write(
        f"{row.primitives} primitives x {row.points} points, {row.axes} sweep axes, "
        f"{row.order} order, {row.step}: {row.ms:.3f} ms\n"
    )


def workload_table(rows: Sequence[StepRow]) -> str:
    """The rows as a section of a Markdown page: a line for each number of primitives, a column a step."""
    points = rows[0].points if rows else POINTS
    lines = [
        "",
        "## The published workload",
        "",
        f"The smooth union of K SuperFrusta at {points:,} points, every primitive at every point, through `wp.Tape`.",
        "Three sweep axes are the default of the authors' CUDA operator, where a primitive is a mixture of three; here",
        "they are three turned copies of each primitive, folded by the union in place of the mixture. Points are in",
        "the order of a curve through space, as a fit keeps them, which is made once, or in random order.",
        "Milliseconds, all cores (one core, in CPU time, in brackets); published: theirs, on a B200.",
        "",
        "| sweep axes | K | order | forward | backward | forward and backward | published forward | published both |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for case in dict.fromkeys((row.axes, row.primitives, row.order) for row in rows):
        own = {row.step: row for row in rows if (row.axes, row.primitives, row.order) == case}
        cells = [f"{own[step].ms:.3f} ({own[step].one_core_ms:.3f})" for step in STEPS]
        known = [own[step].published_ms for step in ("forward", "both")]
        cells += ["" if value is None else f"{value:.2f}" for value in known]
        lines.append(f"| {' | '.join([*map(str, case), *cells])} |")
    return "\n".join(lines) + "\n"
