"""The folder of a fit: which one may be used, and how it is filled so that nothing is half-written or lost."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from resfit.errors import InputError

REPORT_FORMAT = "resfit-report"
"""What `format` says in a report.json of ours."""

REPORT = "report.json"
OURS = ("assembly.json", "parts.glb", "preview.png", "history.npz", "viewer.html", REPORT)
"""Files that a fit writes, the report last: it is what makes a folder ours."""

PARETO = ("pareto.csv", "pareto.json", "pareto.svg")
"""Files that a fit writes if the trade-off was asked for."""

PARETO_FOLDER = "pareto"
"""Where the assemblies of the trade-off lie, assembly_NN.json."""

MAX_REPORT_BYTES = 16 * 1024 * 1024


def default_folder(mesh: Path) -> Path:
    """Where the fit of a mesh file goes unless told otherwise: STEM.resfit in the current folder."""
    return Path(f"{mesh.stem}.resfit")


def holds_fit(folder: Path) -> bool:
    """Whether a report.json of ours lies in `folder`."""
    path = folder / REPORT
    try:
        if path.stat().st_size > MAX_REPORT_BYTES:
            return False
        report = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(report, dict) and report.get("format") == REPORT_FORMAT


def check_folder(folder: Path, inputs: Iterable[Path] = ()) -> None:
    """Refuse a folder that may not be filled, before any work is done for it.

    Args:
        folder: where a fit is to go; it need not exist.
        inputs: files that must survive.

    Raises:
        InputError: if it is no folder, holds other things than a fit of ours, cannot be written to, or one of the
            inputs would be overwritten.
    """
    try:
        if folder.is_dir():
            if any(not _is_temporary(entry) for entry in folder.iterdir()) and not holds_fit(folder):
                raise InputError(
                    f"'{folder}' is not empty and holds no earlier fit; give another folder with -o, or empty it."
                )
        elif os.path.lexists(folder):
            raise InputError(f"'{folder}' is there and is no folder; give another one with -o.")
        taken = {os.path.realpath(folder / name) for name in (*OURS, *PARETO)}
        for path in inputs:
            if os.path.realpath(path) in taken:
                raise InputError(
                    f"the fit would overwrite '{path}', which it reads; give another folder with -o."
                )
        base = next(parent for parent in (folder, *folder.absolute().parents) if os.path.lexists(parent))
        # Asking for permission does not tell about read-only and full file systems: try it.
        probe = base / _temporary_name()
        probe.mkdir()
        probe.rmdir()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "the name is not a valid path"
        raise InputError(f"cannot write to '{folder}': {reason}.") from error


@contextmanager
def filling(folder: Path) -> Iterator[Path]:
    """A temporary folder to write to, whose files become those of `folder` when the block ends well.

    Files of an earlier fit are replaced or removed, other files stay.

    Raises:
        InputError: if the folder may not be used, or writing fails; what was in it before is untouched.
    """
    check_folder(folder)
    present = folder.is_dir()
    # Inside a folder that is there already: it may be a mount, with another file system around it.
    temporary = folder / _temporary_name() if present else folder.with_name(_temporary_name(folder.name))
    try:
        temporary.mkdir(parents=True)
        yield temporary
        if present:
            _replace_files(temporary, folder)
        else:
            os.rename(temporary, folder)
    except OSError as error:
        reason = error.strerror or "the file system refused"
        raise InputError(f"cannot write to '{folder}': {reason}.") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _replace_files(source: Path, folder: Path) -> None:
    """Move all files of `source` to `folder`; what else lies there from an earlier fit goes."""
    new = {path.name for path in source.iterdir() if path.is_file()}
    _replace_curve(source / PARETO_FOLDER, folder / PARETO_FOLDER)
    for name in (*OURS, *PARETO):
        if name not in new:
            (folder / name).unlink(missing_ok=True)
    for name in sorted(new, key=lambda name: (name == REPORT, name)):
        os.replace(source / name, folder / name)


def _replace_curve(source: Path, folder: Path) -> None:
    """The same for the assemblies of the trade-off; other files in their folder stay."""
    if folder.is_dir():
        for path in folder.glob("assembly_*.json"):
            path.unlink()
        if not source.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
    if source.is_dir():
        folder.mkdir(exist_ok=True)
        for path in sorted(source.iterdir()):
            os.replace(path, folder / path.name)


def _temporary_name(name: str = "") -> str:
    return f".{name[:60]}.resfit-{os.getpid()}.tmp"


def _is_temporary(path: Path) -> bool:
    """Whether this is what a killed run left behind."""
    return path.name.startswith(".") and ".resfit-" in path.name and path.name.endswith(".tmp")
