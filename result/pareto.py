"""The trade-off curve of a fit: how good the best assembly of each number of parts is, as numbers, files and a plot."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from html import escape
from pathlib import Path

from ..assembly.assembly import Assembly
from ..assembly.atomic_write import write_bytes
from ..assembly.colors import palette_color
from ..eval.metrics.assembly_metrics import measure_cheap, measure_deviation
from ..fitter.config import FitConfig
from ..fitter.search.pareto import Cut, rising
from ..shape.target import Target

SIZE, MARGIN = (560.0, 320.0), (64.0, 28.0, 20.0, 48.0)
"""Of the plot, in pixels; its room on the left, top, right and bottom."""

INK, FAINT, LINE = "#1e2228", "#6e747c", "#d9dce0"


@dataclass(frozen=True)
class Point:
    """One assembly of the curve."""

    count: int
    """Parts."""
    iou: float
    """At the 128^3 cell centres."""
    objective: float
    worth: float
    """The objective without the price of its parts: more parts are worth more."""
    surface_p95: float | None
    """95th percentile of the distance between the surfaces, mesh units; None without a surface."""
    floats: int
    """Numbers that store it."""
    chosen: bool
    """Whether it is the one that the fit returns."""


@dataclass(frozen=True)
class Curve:
    """All of them, from few parts to many."""

    points: tuple[Point, ...]
    assemblies: tuple[Assembly, ...]

    def save(self, folder: Path) -> None:
        """Write pareto.csv, pareto.json, pareto.svg and pareto/assembly_NN.json."""
        rows = [asdict(point) for point in self.points]
        text = io.StringIO()
        writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        write_bytes(folder / "pareto.csv", text.getvalue().encode())
        write_bytes(folder / "pareto.json", f"{json.dumps(rows, indent=1)}\n".encode())
        write_bytes(folder / "pareto.svg", draw(self.points).encode())
        (folder / "pareto").mkdir()
        for point, assembly in zip(self.points, self.assemblies, strict=True):
            assembly.save(folder / "pareto" / f"assembly_{point.count:02d}.json")


def measure_curve(cuts: Sequence[Cut], target: Target, config: FitConfig, chosen: Assembly) -> Curve:
    """The curve of cuts (fewest parts first), one of which is the chosen assembly; the others' parts have the names and
    colours of those that they stand for."""
    points, assemblies = [], []
    for cut in cuts:
        assembly = chosen if cut.chosen else _assembly_of(cut, config, chosen)
        cheap = measure_cheap(assembly, target, config.device)
        deviation = measure_deviation(assembly, target, config.device)
        points.append(
            Point(
                len(cut.rows),
                round(float(cheap["iou"]), 6),
                round(cut.score.objective, 6),
                round(cut.worth, 6),
                None if deviation is None else float(f"{deviation.p95:.6g}"),
                int(cheap["floats"]),
                cut.chosen,
            )
        )
        assemblies.append(assembly)
    own = next(point.count for point in points if point.chosen)
    # Samples say which is worth more; by cells it may match a little worse.
    kept = rising([(point.count, point.iou) for point in points], own)
    pairs = [pair for pair in zip(points, assemblies, strict=True) if pair[0].count in kept]
    return Curve(tuple(point for point, _ in pairs), tuple(assembly for _, assembly in pairs))


def _assembly_of(cut: Cut, config: FitConfig, chosen: Assembly) -> Assembly:
    """The assembly of a cut; numbers name parts that stand for none of the chosen one's."""
    names = [part.name for part in chosen.primitives]
    while len(names) <= max(cut.places):
        number = len(names)
        while (name := f"part_{number:02d}") in names:
            number += 1
        names.append(name)
    families, colors = [config.primitive] * len(cut.rows), [palette_color(place) for place in cut.places]
    assembly = Assembly.from_rows(cut.rows, families, colors, chosen.transform, chosen.provenance)
    return assembly.renamed([names[place] for place in cut.places])


def draw(points: Sequence[Point]) -> str:
    """IoU and worth against the number of parts, as SVG; the chosen one is marked."""
    left, top, right, bottom = MARGIN
    width, height = SIZE[0] - left - right, SIZE[1] - top - bottom
    most = max(point.count for point in points)

    def place(count: float, value: float) -> tuple[float, float]:
        return left + width * count / most, top + height * (1.0 - min(max(value, 0.0), 1.0))

    body = []
    for step in range(6):
        _, y = place(0, step / 5)
        body.append(f'<path d="M{left:.1f} {y:.1f}h{width:.1f}" stroke="{LINE}"/>')
        body.append(_text(left - 8, y + 4, f"{step / 5:.1f}", "end", FAINT))
    for count in range(0, most + 1, max(1, -(-most // 8))):
        x, y = place(count, 0.0)
        body.append(_text(x, y + 18, str(count), "middle", FAINT))
    body.append(_text(left + width / 2, SIZE[1] - 10, "parts", "middle", INK))
    for number, (label, values) in enumerate(
        (("IoU", [point.iou for point in points]), ("worth", [point.worth for point in points]))
    ):
        color = palette_color(number)
        spots = [place(point.count, value) for point, value in zip(points, values, strict=True)]
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in spots)
        body.append(f'<polyline points="{line}" fill="none" stroke="{color}" stroke-width="2"/>')
        for point, (x, y) in zip(points, spots, strict=True):
            if point.chosen:
                body.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="{color}"/>')
        body.append(_text(left + 12 + 80 * number, top - 10, label, "start", color))
    inside = "".join(body)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{SIZE[0]:g}" height="{SIZE[1]:g}"'
        f' font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="#fff"/>{inside}</svg>\n'
    )


def _text(x: float, y: float, text: str, anchor: str, color: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{color}">{escape(text)}</text>'
