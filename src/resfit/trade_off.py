"""The trade-off curve of a fit: how good the best assembly of each number of parts is, as numbers, files and a plot."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from html import escape
from pathlib import Path

from resfit.assembly.assembly import Assembly
from resfit.assembly.atomic_write import write_bytes
from resfit.assembly.colors import palette_color
from resfit.assembly.provenance import Provenance
from resfit.eval.metrics import measure_cheap, measure_deviation
from resfit.fitter.config import FitConfig
from resfit.fitter.trade_off import Cut
from resfit.target.target import Target

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
    surface_p95: float | None
    """95th percentile of the distance between the surfaces, mesh units; None without a surface."""
    floats: int
    """Numbers that store it."""
    chosen: bool
    """Whether it is the one that the fit returns: the one with the best objective."""


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


def measure_curve(
    cuts: Sequence[Cut], target: Target, config: FitConfig, provenance: Provenance, names: Sequence[str]
) -> Curve:
    """The curve of cuts (richest first) of an assembly whose parts have these names."""
    best = max(cuts, key=lambda cut: cut.score.objective)
    points, assemblies = [], []
    for cut in reversed(cuts):
        families = [config.primitive] * len(cut.rows)
        colors = [palette_color(index) for index in cut.kept]
        assembly = Assembly.from_rows(cut.rows, families, colors, target.transform, provenance)
        assembly = assembly.renamed([names[index] for index in cut.kept])
        cheap = measure_cheap(assembly, target, config.device)
        deviation = measure_deviation(assembly, target, config.device)
        points.append(
            Point(
                len(cut.rows),
                round(float(cheap["iou"]), 6),
                round(cut.score.objective, 6),
                None if deviation is None else float(f"{deviation.p95:.6g}"),
                int(cheap["floats"]),
                cut is best,
            )
        )
        assemblies.append(assembly)
    return Curve(tuple(points), tuple(assemblies))


def draw(points: Sequence[Point]) -> str:
    """IoU and objective against the number of parts, as SVG; the chosen one is marked."""
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
        (("IoU", [point.iou for point in points]), ("objective", [point.objective for point in points]))
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
