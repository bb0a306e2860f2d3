"""`resfit bench fit`: what a whole fit costs, stage by stage, and how that grows with the mesh."""

from __future__ import annotations

import json
import statistics
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from importlib.resources import as_file, files
from pathlib import Path

from resfit.children import python_command

from ..batch import compare
from ..batch.child import ChildRun, run_measured
from ..batch.datasets import Shape, find_shapes
from ..report.results import find_meshes
from .fit_runs import STAGES, FitRow, measure_fit
from .growth import chart, growth_tables, measure_growth
from .harness import cores, cpu_model

NEW_CACHE = "import os, sys; os.environ['WARP_CACHE_PATH'] = sys.argv[2]; "


def _compile_kernels(device: str, cold: bool) -> float | None:
    """Fill the kernel cache, so that no run is charged for it; seconds of compiling all into a new one, if `cold`."""
    run_measured(python_command("-c", compare.WARM, device))
    if not cold:
        return None
    with tempfile.TemporaryDirectory() as cache:
        run: ChildRun = run_measured(python_command("-c", NEW_CACHE + compare.WARM, device, cache))
    try:
        return float(run.stdout)
    except ValueError:
        return None


def say_row(row: FitRow) -> None:
    """One line on stderr, as soon as a row is there."""
    figures = f"{row.faces} faces, {row.primitives} primitives, {row.wall_s:.2f} s, {row.cpu_s:.2f} s CPU"
    slowest = sorted(row.stages, key=lambda name: -row.stages[name])[:4]
    parts = ", ".join(f"{name} {row.stages[name]:.2f}" for name in slowest)
    text = f"{figures}, {row.peak_mb:.0f} MB: {parts}" if row.status == "ok" else f"failed: {row.status}"
    sys.stderr.write(f"{row.name}: {text}\n")
    sys.stderr.flush()


def markdown_page(rows: Sequence[FitRow], preset: str, machine: str, compiled: float | None) -> str:
    """The tables: a line for each mesh, and a line for each stage over all meshes."""
    done = [row for row in rows if row.status == "ok"]
    runs = max((row.runs for row in done), default=0)
    lines = [
        "# A fit by stage",
        "",
        f"Written by `resfit bench fit --markdown docs/fit.md` on: {machine}.",
        f"Preset {preset}, a process a run, medians of {runs}.",
        "Seconds are wall time but for CPU, which counts all cores.",
    ]
    if compiled is not None:
        lines.append(f"Compiling all kernels, once on a machine: {compiled:.1f} s more.")
    lines += [
        "",
        "| mesh | faces | primitives | IoU | wall s | one core s | CPU s | peak MB | loading kernels s |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        figures = (
            f"{row.faces} | {row.primitives} | {row.iou:.3f} | {row.wall_s:.2f}"
            f" | {f'{row.one_core_s:.2f}' if row.one_core_s else ''} | {row.cpu_s:.2f}"
            f" | {row.peak_mb:.0f} | {row.load_kernels_s:.2f}"
        )
        lines.append(f"| {row.name} | {figures if row.status == 'ok' else row.status + ' |' * 7} |")
    return "\n".join([*lines, *_stage_lines(done)]) + "\n"


def _stage_lines(rows: Sequence[FitRow]) -> list[str]:
    """The table of the stages: median and most over the meshes, and the share of all time."""
    if not rows:
        return []
    total = sum(row.wall_s for row in rows)
    lines = ["", "| stage | what | median s | most s | share |", "|---|---|---|---|---|"]
    for name in dict.fromkeys([*STAGES, *(name for row in rows for name in row.stages)]):
        seconds = [row.stages.get(name, 0.0) for row in rows]
        if any(seconds):
            share = sum(seconds) / total
            lines.append(
                f"| {name} | {STAGES.get(name, '')} | {statistics.median(seconds):.3f} | {max(seconds):.3f}"
                f" | {share:.1%} |"
            )
    walls = [row.wall_s for row in rows]
    ratios = [row.one_core_s / row.wall_s for row in rows if row.one_core_s]
    lines.append(f"| all | | {statistics.median(walls):.3f} | {max(walls):.3f} | |")
    mean, late = statistics.fmean(walls), sorted(walls)[max(0, -(-95 * len(walls) // 100) - 1)]
    lines += ["", f"Wall time of a whole command: {mean:.2f} s in the mean, 95 % within {late:.2f} s."]
    if ratios:
        lines.append(f"All cores are {statistics.median(ratios):.2f} times as fast as one (median).")
    return lines


def run_fit_bench(
    meshes: Sequence[str] = (),
    *,
    preset: str = "balanced",
    repeats: int = 3,
    device: str = "auto",
    timeout: float | None = None,
    cold: bool = False,
    one_core: bool = False,
    sizes: Mapping[str, Sequence[int]] | None = None,
    as_json: bool = False,
    markdown: Path | None = None,
) -> list[FitRow]:
    """Measure fits of meshes, then how the stages grow; prints tables or JSON.

    Args:
        meshes: files, folders or lists; the bundled ones if there are none.
        preset: of every fit.
        repeats: runs of each fit.
        device: of the fits.
        timeout: seconds a run.
        cold: also measure compiling the kernels into an empty cache.
        one_core: also measure every fit on one core, for the speed-up of all.
        sizes: what to let grow, and to which sizes, see `growth`; None for nothing.
        as_json: JSON in place of the tables.
        markdown: also write the page here, and the chart of the growth beside it.

    Returns:
        All rows.
    """
    options = {"preset": preset, "device": device}
    compiled = _compile_kernels(device, cold)
    with as_file(files("resfit.data")) as bundled:
        shapes = find_shapes(meshes) or [Shape(path, path.stem) for path in find_meshes([Path(bundled)])]
        rows = []
        for shape in shapes:
            row = replace(measure_fit(shape.path, options, repeats, timeout), name=shape.name)
            if one_core and row.status == "ok":
                with cores(1):
                    row = replace(row, one_core_s=measure_fit(shape.path, options, repeats, timeout).wall_s)
            rows.append(row)
            say_row(rows[-1])
    grown = {} if sizes is None else measure_growth(sizes, options, repeats, timeout, say_row)
    page = markdown_page(rows, preset, cpu_model(), compiled)
    if grown:
        picture = f"{markdown.stem if markdown else 'fit'}_growth.svg"
        page += growth_tables(grown, picture if markdown else None)
        if markdown is not None:
            markdown.with_name(picture).write_text(chart(grown))
    if markdown is not None:
        markdown.write_text(page)
    if as_json:
        document = {
            "machine": cpu_model(),
            "preset": preset,
            "compile_s": compiled,
            "rows": [asdict(row) for row in rows],
            "growth": {
                axis: {size: asdict(row) for size, row in found.items()} for axis, found in grown.items()
            },
        }
        page = json.dumps(document, indent=1) + "\n"
    sys.stdout.write(page)
    return [*rows, *(row for found in grown.values() for row in found.values())]
