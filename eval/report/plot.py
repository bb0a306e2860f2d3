"""Pareto plots as SVG: error against what a reconstruction costs, in primitives, in numbers and in seconds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from statistics import fmean, quantiles

from ...assembly.colors import palette_color
from .tables import Row, shared

PANEL, GAP = (300.0, 260.0), 64.0
"""Width and height of the axes of a panel, and the room before each, in pixels."""
TOP, BOTTOM = 34.0, 62.0
AXES = (("primitive_count", "primitives"), ("floats", "numbers that store it"), ("cpu_s", "CPU seconds"))
INK, FAINT, LINE = "#1e2228", "#6e747c", "#d9dce0"
MARGIN = 0.08
"""Room around the marks, as a share of the axes."""


@dataclass(frozen=True)
class Mark:
    """One method in one panel: the mean over its shapes, and the quartiles."""

    method: str
    color: str
    x: float
    y: float
    x_range: tuple[float, float]
    y_range: tuple[float, float]


@dataclass(frozen=True)
class Scale:
    """From values to pixels; logarithmic along x."""

    low: float
    high: float
    begin: float
    end: float
    logarithmic: bool

    @classmethod
    def around(cls, values: Sequence[float], begin: float, end: float, logarithmic: bool) -> Scale:
        """A scale that shows all values, with some room around them; a linear one begins at 0."""
        if logarithmic:
            low, high = math.log10(min(values)), math.log10(max(values))
            # At least two thirds of a decade, so that there is a round value in it.
            room = max(MARGIN * (high - low), 0.5 * (0.67 - high + low))
            return cls(low - room, high + room, begin, end, True)
        return cls(0.0, max(max(values), 1e-6) * (1.0 + MARGIN), begin, end, False)

    def __call__(self, value: float) -> float:
        place = math.log10(value) if self.logarithmic else value
        return self.begin + (self.end - self.begin) * (place - self.low) / (self.high - self.low)

    def ticks(self) -> list[float]:
        """Round values within the scale."""
        if self.logarithmic:
            powers = range(math.floor(self.low), math.ceil(self.high) + 1)
            steps = (1, 2, 5) if self.high - self.low < 2.0 else (1,)
            found = [step * 10.0**power for power in powers for step in steps]
            return [value for value in found if self.low <= math.log10(value) <= self.high]
        raw = (self.high - self.low) / 5.0
        unit = 10.0 ** math.floor(math.log10(raw))
        step = next(unit * factor for factor in (1.0, 2.0, 5.0, 10.0) if unit * factor >= raw)
        return [index * step for index in range(int(self.high / step) + 1)]


def pareto_svg(rows: Sequence[Row]) -> str:
    """The plots, of the closed shapes that every method finished; a sentence where there is none."""
    done = [row for row in rows if row["status"] == "ok" and row["closed"]]
    methods = list(dict.fromkeys(row["method"] for row in rows))
    common = shared(done) or done
    width = len(AXES) * (PANEL[0] + GAP) + 20.0
    height = TOP + PANEL[1] + BOTTOM
    body = [_text(width / 2, height / 2, "no closed shape was finished", "middle")]
    if common:
        body = [_text(GAP, 20, "Mean and quartiles; down and to the left is better", "start", FAINT)]
        for index, (key, label) in enumerate(AXES):
            marks = make_marks(common, methods, key)
            left = GAP + index * (PANEL[0] + GAP)
            body += _panel(marks, left, label, index == 0)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}"'
        f' viewBox="0 0 {width:.0f} {height:.0f}" font-family="Helvetica, Arial, sans-serif" font-size="12">\n'
        f'<rect width="100%" height="100%" fill="#ffffff"/>\n' + "\n".join(body) + "\n</svg>\n"
    )


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


def _panel(marks: Sequence[Mark], left: float, label: str, first: bool) -> list[str]:
    right, top, bottom = left + PANEL[0], TOP, TOP + PANEL[1]
    across = Scale.around([value for mark in marks for value in (mark.x, *mark.x_range)], left, right, True)
    down = Scale.around([value for mark in marks for value in (mark.y, *mark.y_range)], bottom, top, False)
    body = []
    for value in down.ticks():
        body.append(_line(left, down(value), right, down(value), LINE))
        body.append(_text(left - 6, down(value) + 4, f"{value:.3g}", "end", FAINT))
    for value in across.ticks():
        body.append(_line(across(value), top, across(value), bottom, LINE))
        body.append(_text(across(value), bottom + 16, f"{value:g}", "middle", FAINT))
    body.append(_line(left, bottom, right, bottom, INK))
    body.append(_line(left, top, left, bottom, INK))
    body.append(_text((left + right) / 2, bottom + 38, label, "middle"))
    if first:
        x, y = left - 44, (top + bottom) / 2
        body.append(
            f'<text transform="translate({x:.1f} {y:.1f}) rotate(-90)" text-anchor="middle">1 - IoU</text>'
        )
    steps = [(across(mark.x), down(mark.y)) for mark in front(marks)]
    if len(steps) > 1:
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in steps)
        body.append(f'<polyline points="{points}" fill="none" stroke="{FAINT}" stroke-dasharray="3 3"/>')
    for mark in marks:
        x, y = across(mark.x), down(mark.y)
        body.append(_line(across(mark.x_range[0]), y, across(mark.x_range[1]), y, mark.color))
        body.append(_line(x, down(mark.y_range[0]), x, down(mark.y_range[1]), mark.color))
        body.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="{mark.color}" stroke="#ffffff"/>')
    return body + _labels(marks, across, down, right)


def _labels(marks: Sequence[Mark], across: Scale, down: Scale, right: float) -> list[str]:
    """Names beside the marks, moved down where they would lie on each other."""
    body: list[str] = []
    taken: list[tuple[float, float]] = []
    for mark in sorted(marks, key=lambda mark: down(mark.y)):
        x, y = across(mark.x), down(mark.y) - 8.0
        width = 6.5 * len(mark.method) + 10.0
        end = x + width > right
        begin = x - width if end else x
        while any(abs(begin - other) < width and abs(y - level) < 13.0 for other, level in taken):
            y += 13.0
        taken.append((begin, y))
        anchor, place = ("end", x - 8.0) if end else ("start", x + 8.0)
        body.append(_text(place, y, mark.method, anchor, mark.color))
    return body


def _line(x: float, y: float, u: float, v: float, color: str) -> str:
    return f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{u:.1f}" y2="{v:.1f}" stroke="{color}"/>'


def _text(x: float, y: float, text: str, anchor: str, color: str = INK) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{color}">{escape(text)}</text>'
