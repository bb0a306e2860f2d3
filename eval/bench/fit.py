"""`resfit bench fit`: what a whole fit costs, stage by stage, one process a mesh.

A run is `resfit fit` as people call it, imports and files included. Its own report says what the stages took; when the
stages of the target begin, and the writing, it tells as it goes. What no stage claims is the row `other`.
"""

from __future__ import annotations

import json
import statistics
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

from resfit.children import python_command

from .. import compare
from ..child import ChildRun, run_measured
from ..datasets import Shape, find_shapes
from ..results import find_meshes
from .kernels import cores, cpu_model

STAGES = {
    "start": "the interpreter, imports, start of Warp",
    "load": "reading and welding the mesh",
    "solid": "deciding the solid, trees of triangles",
    "grid": "signed distances on the grid",
    "samples": "sample points and their distances",
    "split": "taking the mesh apart",
    "prepare": "set-up of the rounds",
    "decompose": "regions of what is unexplained",
    "propose": "candidates fitted to regions",
    "select": "greedy choice",
    "refine": "all primitives moved together",
    "prune": "blends, and primitives that do not pay",
    "field": "the union on the grid",
    "wait": "for the other beginning, which goes on beside this one",
    "merge": "one candidate in the place of several",
    "finish": "last blends and refinements",
    "tolerance": "distances between the surfaces, where a tolerance is wanted",
    "curve": "the trade-off",
    "metrics": "measuring the result",
    "preview": "preview.png",
    "export": "parts.glb and viewer.html, as far as they take longer than the preview, beside which they are made",
    "write": "the other files",
    "exit": "the end of the process",
    "other": "what no stage claims, such as targets of single parts",
}
"""Stages in their order, and what they are."""

TARGET = ("load", "solid", "grid", "samples")
"""The report has these as one; when each begins is told while the fit runs."""

CHILD = """
import json, os, sys
from pathlib import Path
mesh, folder, log, options = sys.argv[1:]
os.dup2(os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), 2)
from resfit.cli import leave
from resfit.cli.fit import run_fit
leave(run_fit(Path(mesh), Path(folder), "json", json.loads(options)))
"""
"""What a child does. A log of its own, because of what a child says only the last part is kept."""

NEW_CACHE = "import os, sys; os.environ['WARP_CACHE_PATH'] = sys.argv[2]; "


@dataclass(frozen=True)
class FitRow:
    """One mesh, fitted some times; figures are medians over the runs."""

    name: str
    status: str
    """ok, or why it failed in a sentence; figures are 0 then."""
    runs: int = 0
    faces: int = 0
    primitives: int = 0
    iou: float = 0.0
    wall_s: float = 0.0
    cpu_s: float = 0.0
    """User and system, of the whole process."""
    peak_mb: float = 0.0
    """MB (1e6 bytes)."""
    load_kernels_s: float = 0.0
    """Wall seconds of loading kernels from the cache, contained in the stages in which they are first needed."""
    stages: Mapping[str, float] = field(default_factory=dict)
    """Wall seconds by stage, in the order of STAGES; they add up to the wall time of a run."""
    one_core_s: float = 0.0
    """Wall seconds on one core, 0 unless measured."""


def fit_once(mesh: Path, options: Mapping[str, Any], timeout: float | None = None) -> FitRow:
    """Fit a mesh in a process of its own.

    Args:
        mesh: the file.
        options: keywords of `resfit.fit`: the preset, fields of the configuration.
        timeout: wall seconds after which it is given up.
    """
    with tempfile.TemporaryDirectory() as work:
        folder, log = Path(work) / "fit", Path(work) / "log.jsonl"
        given = json.dumps(dict(options))
        run = run_measured(python_command("-c", CHILD, str(mesh), str(folder), str(log), given), timeout)
        said = log.read_text(errors="replace") if log.exists() else ""
        path = folder / "report.json"
        if run.exit_code or not path.exists():
            return FitRow(mesh.stem, replace(run, stderr=said or run.stderr).complaint)
        report = json.loads(path.read_text())
    return FitRow(
        name=mesh.stem,
        status="ok",
        runs=1,
        faces=report["input"]["faces"],
        primitives=report["metrics"]["primitive_count"],
        iou=report["metrics"]["iou"],
        wall_s=run.wall_s,
        cpu_s=run.cpu_s,
        peak_mb=run.peak_mb,
        load_kernels_s=report["timings"].get("compile", 0.0),
        stages=stage_seconds(report["timings"], begins(said), run.wall_s),
    )


def begins(log: str) -> dict[str, float]:
    """Seconds at which each stage or event first began, by its name, from the lines of `--progress json`."""
    found: dict[str, float] = {}
    for line in log.splitlines():
        if line.startswith("{"):
            event = json.loads(line)
            found.setdefault(event.get("stage", event["event"]), event["elapsed_s"])
    return found


def stage_seconds(
    timings: Mapping[str, float], begin: Mapping[str, float], wall_s: float
) -> dict[str, float]:
    """Wall seconds by stage, in the order of STAGES, that add up to the wall time.

    Args:
        timings: of report.json; the target is one stage there.
        begin: when stages and events began, see `begins`.
        wall_s: of the whole process.
    """
    stages = {
        "export" if name == "parts" else name: seconds
        for name, seconds in timings.items()
        if name not in ("compile", "target")
    }
    starts = [begin[name] for name in TARGET]
    for name, start, end in zip(TARGET, starts, starts[1:], strict=False):
        stages[name] = end - start
    stages["samples"] = max(0.0, timings["target"] - (starts[-1] - starts[0]))
    first = min((time for name, time in begin.items() if time > starts[-1]), default=starts[-1])
    stages["prepare"] = max(0.0, first - starts[0] - timings["target"] - stages.get("split", 0.0))
    writing = begin["done"] - begin["writing"]
    stages["write"] = max(0.0, writing - stages.get("export", 0.0) - stages.get("preview", 0.0))
    # Reading the mesh begins where the start ends; both clocks run on from there.
    stages["exit"] = max(0.0, wall_s - timings["start"] - (begin["done"] - starts[0]))
    stages["other"] = wall_s - sum(stages.values())
    order = [*[name for name in STAGES if name in stages], *[name for name in stages if name not in STAGES]]
    return {name: round(stages[name], 4) for name in order}


def measure_fit(
    mesh: Path, options: Mapping[str, Any], repeats: int = 3, timeout: float | None = None
) -> FitRow:
    """Medians over some runs of the same fit; a run that fails ends it."""
    runs: list[FitRow] = []
    for _ in range(repeats):
        runs.append(fit_once(mesh, options, timeout))
        if runs[-1].status != "ok":
            return runs[-1]
    names = list(dict.fromkeys(name for run in runs for name in run.stages))

    def middle(value: Callable[[FitRow], float]) -> float:
        return round(statistics.median(value(run) for run in runs), 4)

    return replace(
        runs[0],
        runs=len(runs),
        wall_s=middle(lambda run: run.wall_s),
        cpu_s=middle(lambda run: run.cpu_s),
        peak_mb=round(middle(lambda run: run.peak_mb), 1),
        load_kernels_s=middle(lambda run: run.load_kernels_s),
        stages={name: middle(lambda run, name=name: run.stages.get(name, 0.0)) for name in names},
    )


def compile_kernels(device: str, cold: bool) -> float | None:
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
    return "\n".join([*lines, *stage_lines(done)]) + "\n"


def stage_lines(rows: Sequence[FitRow]) -> list[str]:
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
    # It measures with what is here.
    from .growth import chart, growth_tables, measure_growth

    options = {"preset": preset, "device": device}
    compiled = compile_kernels(device, cold)
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
