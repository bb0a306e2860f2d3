"""The trade-off curve of a fit: how good the best assembly of each number of parts is, as numbers, files and a plot."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..assembly.assembly import Assembly
from ..assembly.atomic_write import write_bytes
from ..assembly.colors import palette_color
from ..eval.metrics.assembly_metrics import measure_cheap, measure_deviation
from ..eval.report.figure import svg_plot
from ..fitter.config import FitConfig
from ..fitter.search.pareto import Cut, rising
from ..shape.target import Target

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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

    from matplotlib.ticker import MaxNLocator

    def fill(panels: Sequence[Axes]) -> None:
        axes = panels[0]
        axes.set(xlabel="parts", ylim=(0.0, 1.0))
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        counts, chosen = [point.count for point in points], [point.chosen for point in points].index(True)
        for number, (label, values) in enumerate(
            (("IoU", [point.iou for point in points]), ("worth", [point.worth for point in points]))
        ):
            axes.plot(
                counts,
                values,
                "-o",
                color=palette_color(number),
                label=label,
                markevery=[chosen],
                clip_on=False,
            )
        axes.set_xlim(left=0.0)

    return svg_plot(1, fill, panel=(5.0, 3.4))
