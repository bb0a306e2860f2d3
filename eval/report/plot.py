"""Pareto plots: error against what a reconstruction costs, in primitives, in numbers and in seconds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean, quantiles
from typing import TYPE_CHECKING

from ...assembly.colors import palette_color
from .figure import FAINT, logarithmic, svg_plot
from .tables import Row, shared

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AXES = (("primitive_count", "primitives"), ("floats", "numbers that store it"), ("cpu_s", "CPU seconds"))


@dataclass(frozen=True)
class Mark:
    """One method in one panel: the mean over its shapes, and the quartiles."""

    method: str
    color: str
    x: float
    y: float
    x_range: tuple[float, float]
    y_range: tuple[float, float]


def pareto_svg(rows: Sequence[Row]) -> str:
    """The plots, of the closed shapes that every method finished; a sentence where there is none."""
    done = [row for row in rows if row["status"] == "ok" and row["closed"]]
    methods = list(dict.fromkeys(row["method"] for row in rows))
    common = shared(done) or done

    def draw(panels: Sequence[Axes]) -> None:
        panels[0].set_ylabel("1 - IoU")
        for axes, (key, label) in zip(panels, AXES, strict=True):
            axes.set_xlabel(label)
            _draw(axes, make_marks(common, methods, key))

    title = "Mean and quartiles; down and to the left is better" if common else "no closed shape was finished"
    return svg_plot(len(AXES), draw, title)


def make_marks(rows: Sequence[Row], methods: Sequence[str], key: str) -> list[Mark]:
    """A mark for each method that has rows: 1 - IoU against `key`."""
    marks = []
    for index, method in enumerate(methods):
        own = [row for row in rows if row["method"] == method and row.get(key) is not None]
        if own:
            across = [max(float(row[key]), 1e-2) for row in own]
            down = [1.0 - row["iou"] for row in own]
            marks.append(
                Mark(
                    method,
                    palette_color(index),
                    fmean(across),
                    fmean(down),
                    _quartiles(across),
                    _quartiles(down),
                )
            )
    return marks


def front(marks: Sequence[Mark]) -> list[Mark]:
    """The marks that no other one beats in both directions, from left to right."""
    best, kept = math.inf, []
    for mark in sorted(marks, key=lambda mark: (mark.x, mark.y)):
        if mark.y < best:
            best = mark.y
            kept.append(mark)
    return kept


def _quartiles(values: Sequence[float]) -> tuple[float, float]:
    if len(values) < 2:
        return values[0], values[0]
    low, _, high = quantiles(values, n=4, method="inclusive")
    return low, high


def _draw(axes: Axes, marks: Sequence[Mark]) -> None:
    steps = front(marks)
    if len(steps) > 1:
        axes.plot([mark.x for mark in steps], [mark.y for mark in steps], "--", color=FAINT, linewidth=1)
    for mark in marks:
        axes.plot(mark.x_range, (mark.y, mark.y), color=mark.color, linewidth=1)
        axes.plot((mark.x, mark.x), mark.y_range, color=mark.color, linewidth=1)
        axes.plot(mark.x, mark.y, "o", color=mark.color, markeredgecolor="white", label=mark.method)
    if marks:
        logarithmic(axes, "x")
        axes.set_ylim(bottom=0.0)
