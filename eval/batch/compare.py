"""Methods on the same shapes: one process a fit, rows as JSON lines that a later run goes on from.

A row is finished once it is written. It depends on the mesh's bytes, the method, the time allowed, the version and what
is measured: if only the last has changed, the fit that is there is scored again.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from resfit.children import python_command
from resfit.errors import InputError

from ..metrics.evaluate import TargetSurface, evaluate
from .child import ChildRun, run_measured
from .datasets import Shape

ROWS = "rows.jsonl"

OUTPUTS = ("assembly.json", "*.glb", "*.obj", "*.ply", "*.stl", "*/assembly.json")
"""Where a method's result may lie in its folder if the method does not say: the first that is there."""

USAGE = 2
"""Exit code of a method that cannot work here (a package is missing) or refuses its input: worth another try."""

WARM = (
    "from resfit.kernels.runtime.launch import choose_device; from resfit.kernels.precompile import precompile_kernels;"
    " import sys; sys.stdout.write(str(precompile_kernels(choose_device(sys.argv[1]))))"
)


@dataclass(frozen=True)
class Comparison:
    """Options of a comparison."""

    out: Path
    """Folder for rows, tables, pictures, and the methods' results."""
    methods: tuple[str, ...]
    timeout: float | None = 600.0
    """Seconds a fit."""
    emd: bool = True
    features: str | None = None
    """See `features.make_features`."""
    device: str = "auto"
    """Of the metrics."""
    fresh: bool = False
    """Whether to compute finished rows again."""

    def command(self, method: str, mesh: Path, folder: Path) -> list[str]:
        """Command line of a method in a process of its own."""
        return python_command("-m", "resfit.eval.methods", method, str(mesh.resolve()), str(folder.resolve()))

    def fit_key(self, shape: Shape, method: str) -> str:
        """Cache key of a fit."""
        try:
            digest = hashlib.sha256(shape.path.read_bytes()).hexdigest()
        except OSError:
            digest = "unreadable"
        return _short(version("resfit"), method, self.timeout, shape.name, digest)

    def row_key(self, fit_key: str) -> str:
        """Cache key of a row."""
        return _short(fit_key, self.emd, self.features)


def _short(*values: object) -> str:
    return hashlib.sha256(json.dumps([str(value) for value in values]).encode()).hexdigest()[:16]


def check_methods(names: Iterable[str], known: Iterable[str]) -> tuple[str, ...]:
    """The methods asked for, each once.

    Raises:
        InputError: if there is none, or one is unknown.
    """
    known = list(known)
    asked = tuple(dict.fromkeys(name.strip() for name in names if name.strip()))
    for name in asked:
        # What follows a colon is the method's own business.
        if name.partition(":")[0] not in known and name not in known:
            raise InputError(f"there is no method '{name}'; known are {', '.join(known)}.")
    if not asked:
        raise InputError(f"give at least one method; known are {', '.join(known)}.")
    return asked


def check_out(folder: Path) -> None:
    """Refuse a folder in which something else lies.

    Raises:
        InputError: if it is there, not empty, and holds no rows of ours.
    """
    if folder.is_dir() and any(folder.iterdir()) and not (folder / ROWS).exists():
        raise InputError(
            f"'{folder}' is not empty and holds no earlier comparison; give another folder with -o."
        )
    if folder.exists() and not folder.is_dir():
        raise InputError(f"'{folder}' is there and is no folder; give another one with -o.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"'{folder}' cannot be made: {error.strerror or error}.") from error


def run_comparison(
    comparison: Comparison,
    shapes: Sequence[Shape],
    on_row: Callable[[dict[str, Any]], None] | None = None,
) -> list[dict[str, Any]]:
    """Rows of all shapes by all methods, shape by shape; each is written down as soon as it is there.

    Args:
        comparison: what to do.
        shapes: the meshes.
        on_row: called with each row, finished before or not.
    """
    check_out(comparison.out)
    path = comparison.out / ROWS
    rows, compile_s, earlier = [], None, {} if comparison.fresh else read_rows(path)
    if comparison.fresh:
        path.unlink(missing_ok=True)
    path.touch()
    for shape in shapes:
        surface: TargetSurface | str | None = None
        for method in comparison.methods:
            fit_key = comparison.fit_key(shape, method)
            row = earlier.get(comparison.row_key(fit_key))
            if row is None or (row["status"] == "ok" and not (comparison.out / row["prediction"]).exists()):
                if surface is None:
                    surface = _read_target(shape, comparison.device)
                if compile_s is None:
                    compile_s = _warm_up(comparison.device)
                row = _make_row(comparison, shape, method, surface, earlier.get(fit_key))
                row["compile_s"] = compile_s
                with path.open("a", encoding="utf-8") as stream:
                    stream.write(json.dumps(row, allow_nan=False) + "\n")
            rows.append(row)
            if on_row is not None:
                on_row(row)
    return rows


def _warm_up(device: str) -> float:
    """Compile what is not in the cache yet, so that no fit is charged for it; the seconds that it took."""
    said = run_measured(python_command("-c", WARM, device)).stdout
    try:
        return round(float(said), 3)
    except ValueError:
        return 0.0


def written_rows(path: Path) -> Iterator[dict[str, Any]]:
    """The rows of a file of JSON lines, none if it does not exist."""
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        # The line that was being written when a run was killed is none.
        with suppress(ValueError):
            yield json.loads(line)


def read_rows(path: Path) -> dict[str, dict[str, Any]]:
    """Finished rows by their key, and by that of their fit; the last one of a key counts."""
    rows = {}
    for row in written_rows(path):
        if row["exit_code"] != USAGE:
            rows[row["key"]] = row
            if row["status"] == "ok":
                rows[row["fit_key"]] = row
    return rows


def _read_target(shape: Shape, device: str) -> TargetSurface | str:
    """The target's surface, or why there is none."""
    try:
        return TargetSurface.of(shape.path, device)
    except Exception as error:
        # One bad mesh must not stop the others, whatever is wrong with it.
        return str(error) or type(error).__name__


def _make_row(
    comparison: Comparison,
    shape: Shape,
    method: str,
    surface: TargetSurface | str,
    fitted: dict[str, Any] | None,
) -> dict[str, Any]:
    """Fit and score one shape by one method, or score the fit that is there."""
    fit_key = comparison.fit_key(shape, method)
    row: dict[str, Any] = {
        "key": comparison.row_key(fit_key),
        "fit_key": fit_key,
        "mesh": shape.name,
        "category": shape.category,
        "method": method,
    }
    if isinstance(surface, str):
        return row | {"status": "failed", "exit_code": USAGE, "error": surface}
    if fitted is not None and (comparison.out / fitted["prediction"]).exists():
        prediction = comparison.out / fitted["prediction"]
        row |= {key: fitted[key] for key in ("exit_code", "wall_s", "cpu_s", "peak_mb")}
    else:
        folder = comparison.out / _plain(method) / shape.name
        # What an earlier run left must not pass for this one's result.
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        run = run_measured(comparison.command(method, shape.path, folder), comparison.timeout)
        row |= {
            "exit_code": run.exit_code,
            "wall_s": round(run.wall_s, 3),
            "cpu_s": round(run.cpu_s, 3),
            "peak_mb": round(run.peak_mb, 1),
        }
        found = None if run.exit_code else find_output(folder, run)
        if found is None:
            error = run.complaint if run.exit_code else "it wrote neither an assembly.json nor a mesh"
            return row | {"status": "timeout" if run.timed_out else "failed", "error": error}
        prediction = found
    try:
        scores = evaluate(
            prediction, surface, emd=comparison.emd, features=comparison.features, device=comparison.device
        )
    except Exception as error:
        return row | {"status": "failed", "error": f"it cannot be scored: {error or type(error).__name__}"}
    whole, folder = prediction.resolve(), comparison.out.resolve()
    shown = whole.relative_to(folder) if whole.is_relative_to(folder) else whole
    return row | scores | {"status": "ok", "prediction": str(shown)}


def _plain(method: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in method)


def find_output(folder: Path, run: ChildRun) -> Path | None:
    """Output of a method: the path that its last line names, else the first of OUTPUTS in its folder."""
    lines = [line.strip() for line in run.stdout.splitlines() if line.strip()]
    if lines and len(lines[-1]) < 4096 and Path(lines[-1]).exists():
        return Path(lines[-1])
    for pattern in OUTPUTS:
        found = sorted(folder.glob(pattern))
        if found:
            return found[0]
    return None
