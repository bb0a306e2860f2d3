"""Fits of one mesh, each in a process of its own: wall seconds of every stage, medians over repeated runs.

A run is `resfit fit` as people call it, imports and files included. Its own report says what the stages took; when the
stages of the target begin, and the writing, it tells as it goes. What no stage claims is the row `other`.
"""

from __future__ import annotations

import json
import statistics
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from resfit.children import python_command

from ..batch.child import run_measured

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
from resfit.cli.single import run_fit
leave(run_fit(Path(mesh), Path(folder), "json", json.loads(options)))
"""
"""What a child does. A log of its own, because of what a child says only the last part is kept."""


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


def _fit_once(mesh: Path, options: Mapping[str, Any], timeout: float | None = None) -> FitRow:
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
        runs.append(_fit_once(mesh, options, timeout))
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
