"""The table and the contact sheets of fits in docs/: one process each for all meshes of some folders.

    python -m resfit.eval.report.results [FOLDER...] [--out docs] [--preset balanced] [--work out/results] [--fresh]

Rows are kept as JSON lines in the work folder: what is finished is not computed again by the same version.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib.metadata import version
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

from resfit.children import python_command

from ...assembly.transform import NORMALISED_SIDE
from ...shape.formats import MESH_SUFFIXES
from ..batch.compare import written_rows
from .contact_sheet import draw_sheet
from .results_table import worst_rows, write_table

GRACE_SECONDS = 60.0
"""After the time is up, a fit may take this long to write what it has."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Fit everything and write the table and two pictures; returns 3 if a mesh ended in a defect or crash, else 0."""
    parser = argparse.ArgumentParser(prog="python -m resfit.eval.report.results", description=__doc__)
    parser.add_argument(
        "folders", nargs="*", type=Path, help="folders of meshes; the bundled ones unless given"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("docs"), help="where results.md, results.png and worst.png go"
    )
    parser.add_argument("--work", type=Path, default=Path("out/results"), help="where the fits go")
    parser.add_argument("--preset", default="balanced")
    parser.add_argument("--timeout", type=float, default=600.0, help="seconds a mesh")
    parser.add_argument("--fresh", action="store_true", help="compute finished rows again")
    options = parser.parse_args(arguments)
    with as_file(files("resfit.data")) as bundled:
        meshes = find_meshes(options.folders or [Path(bundled)])
        if not meshes:
            parser.error("there is no mesh in these folders")
        rows = run_all(meshes, options.work / options.preset, options.preset, options.timeout, options.fresh)
    options.out.mkdir(parents=True, exist_ok=True)
    write_table(rows, options.out / "results.md", options.preset)
    draw_sheet(rows, options.work / options.preset, options.out / "results.png")
    worst = worst_rows(rows)
    if worst:
        draw_sheet(worst, options.work / options.preset, options.out / "worst.png", columns=2)
    return 3 if any(row["exit_code"] not in (0, 2, 4) for row in rows) else 0


def find_meshes(folders: Sequence[Path]) -> list[Path]:
    """All meshes directly in the folders, by name."""
    found = [path for folder in folders for path in folder.iterdir() if path.suffix.lower() in MESH_SUFFIXES]
    return sorted(found, key=lambda path: path.name)


def run_all(
    meshes: Sequence[Path], work: Path, preset: str, timeout: float, fresh: bool
) -> list[dict[str, Any]]:
    """One row a mesh, in their order; each is written down as soon as it is there.

    Args:
        meshes: files.
        work: folder for the fits and rows.jsonl.
        preset: of the fits.
        timeout: seconds a mesh, 0 is off.
        fresh: compute finished rows again.
    """
    work.mkdir(parents=True, exist_ok=True)
    path = work / "rows.jsonl"
    finished = {} if fresh else _read_rows(path, work)
    rows, warm = [], False
    for number, mesh in enumerate(meshes, 1):
        key = row_key(mesh, preset, timeout)
        row = finished.get(key)
        if row is None:
            if not warm:
                _warm_up()
                warm = True
            row = {"key": key, **fit_one(mesh, work, preset, timeout)}
            with path.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(row) + "\n")
        rows.append(row)
        sys.stderr.write(f"{number}/{len(meshes)} {_brief(row)}\n")
    return rows


def row_key(mesh: Path, preset: str, timeout: float) -> str:
    """Cache key of a row: the mesh's bytes and name, the options, the version."""
    digest = hashlib.sha256(mesh.read_bytes()).hexdigest()
    return hashlib.sha256(
        f"{version('resfit')}|{preset}|{timeout:g}|{mesh.name}|{digest}".encode()
    ).hexdigest()[:16]


def _read_rows(path: Path, work: Path) -> dict[str, dict[str, Any]]:
    """Finished rows by their key; the last one of a key counts. A row without its picture is not finished."""
    return {
        row["key"]: row
        for row in written_rows(path)
        if row["exit_code"] == 2 or (work / f"{row['mesh']}.resfit" / "preview.png").exists()
    }


def _warm_up() -> None:
    """Compile what is not in the cache yet, so that no mesh is charged for it."""
    with tempfile.TemporaryDirectory() as folder, as_file(files("resfit.data") / "potted_cactus.glb") as mesh:
        _call(mesh, Path(folder) / "warm.resfit", "fast", 0.0)


def fit_one(mesh: Path, work: Path, preset: str, timeout: float) -> dict[str, Any]:
    """Fit a mesh in a process of its own and describe what came of it."""
    folder = work / f"{mesh.name}.resfit"
    code, message = _call(mesh, folder, preset, timeout)
    row: dict[str, Any] = {"mesh": mesh.name, "exit_code": code}
    if code not in (0, 4):
        return row | {"error": message or f"ended by signal {-code}"}
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    document = json.loads((folder / "assembly.json").read_text(encoding="utf-8"))
    found = report["input"]
    row |= {name: found[name] for name in ("faces", "closed", "kind", "sentence", "notes")}
    row |= report["metrics"]
    side = NORMALISED_SIDE * document["transform"]["scale"]
    row["deviation"] = report["deviation"] and report["deviation"]["p95"] / side
    return row | {"status": report["status"]["sentence"], "machine": report["machine"]}


def _call(mesh: Path, folder: Path, preset: str, timeout: float) -> tuple[int, str]:
    """Exit code of `resfit fit`, and the last sentence that it wrote on stderr, without paths."""
    # From the mesh's own folder, so that messages hold its name and not where it lies here.
    command = python_command(
        "-m", "resfit", "fit", mesh.name, "-o", str(folder.resolve()), "--preset", preset
    )
    command += ["--progress", "none"] + (["--timeout", f"{timeout:g}"] if timeout else [])
    try:
        done = subprocess.run(
            command,
            cwd=mesh.parent,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=timeout + GRACE_SECONDS if timeout else None,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return -9, f"no answer within {timeout + GRACE_SECONDS:g} s"
    lines = [line for line in done.stderr.splitlines() if line.startswith("resfit: ")]
    return done.returncode, (lines or [""])[-1].removeprefix("resfit: ").partition("; the log is")[0]


def _brief(row: dict[str, Any]) -> str:
    if "error" in row:
        return f"{row['mesh']}: exit {row['exit_code']}, {row['error']}"
    return f"{row['mesh']}: IoU {row['iou']:.3f}, {row['primitive_count']} parts, {row['cpu_s']:.1f} CPU s"


if __name__ == "__main__":
    sys.exit(main())
