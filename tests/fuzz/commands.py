"""`resfit` as users run it, and whether it ended as the documentation says."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from fuzz.harness import Wrong

RESFIT = str(Path(sys.executable).with_name("resfit"))
FILES = {"assembly.json", "parts.glb", "preview.png", "history.npz", "viewer.html", "report.json"}
"""What a fit writes."""

QUICK = ("--preset", "fast", "--max-primitives", "4", "--progress", "none")


@dataclass(frozen=True)
class Done:
    """A command that ended."""

    code: int
    out: str
    err: str

    @property
    def tail(self) -> str:
        """What it said last."""
        return " ".join(self.err.split())[-300:]


def run(
    command: Sequence[str] | str,
    folder: Path,
    environment: Mapping[str, str | None] | None = None,
    timeout: float | None = None,
) -> Done:
    """Run a command, or a line of bash, in a folder.

    Args:
        environment: variables that are set, or removed where the value is None.
    """
    if isinstance(command, str):
        command = ["bash", "-c", command]
    changed = {**os.environ, "PYTHONPATH": None, **(environment or {})}
    done = subprocess.run(
        [*command],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        timeout=timeout,
        env={name: value for name, value in changed.items() if value is not None},
    )
    return Done(done.returncode, done.stdout.decode(errors="replace"), done.stderr.decode(errors="replace"))


def start(
    command: Sequence[str], folder: Path, environment: Mapping[str, str] | None = None
) -> subprocess.Popen[str]:
    """Start a command; its output is read by `ended`."""
    return subprocess.Popen(
        [*command],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        env={**os.environ, **(environment or {})},
    )


def ended(process: subprocess.Popen[str]) -> Done:
    """Wait for a command."""
    out, err = process.communicate()
    return Done(process.returncode, out, err)


def fit_command(mesh: Path, out: Path, *options: str) -> list[str]:
    """A quick fit."""
    return [RESFIT, "fit", str(mesh), "-o", str(out), *QUICK, *options]


def check_said(done: Done) -> None:
    """No defect was told, and no traceback."""
    for word in ("defect of resfit", "Traceback", "Exception ignored", "Warning:"):
        if word in done.err:
            raise Wrong(f"exit code {done.code}, and stderr tells of a defect: {done.tail}")


def check_code(done: Done, codes: Collection[int]) -> None:
    """It ended with one of these codes, and told of no defect."""
    check_said(done)
    if done.code not in codes:
        raise Wrong(f"exit code {done.code} instead of {sorted(codes)}: {done.tail}")


def check_folder(done: Done, folder: Path) -> None:
    """A whole result if the code says so, and none of its files if it does not."""
    there = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    if done.code in (0, 4):
        check_whole(folder)
    elif there & FILES:
        raise Wrong(f"exit code {done.code}, but it wrote {sorted(there & FILES)}")


def check_whole(folder: Path) -> None:
    """One result, its report about its assembly, with parts and strict JSON."""
    there = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    if not there >= FILES:
        raise Wrong(f"the result lacks {sorted(FILES - there)}")

    def refuse(name: str) -> None:
        raise Wrong(f"{name} in a JSON file of the result")

    assembly, report = (
        json.loads((folder / name).read_text(encoding="utf-8"), parse_constant=refuse)
        for name in ("assembly.json", "report.json")
    )
    if [part["name"] for part in report["parts"]] != [part["name"] for part in assembly["primitives"]]:
        raise Wrong("the report is about another assembly")
    if not assembly["primitives"]:
        raise Wrong("the result is an empty assembly")


def leftovers(folder: Path) -> list[str]:
    """Temporary files and folders of ours, hidden or not."""
    return sorted(
        str(path.relative_to(folder))
        for path in folder.rglob("*")
        if "resfit-" in path.name and ".tmp" in path.name
    )


def digests(folder: Path) -> dict[str, str]:
    """Hashes of the files in a folder and below, but for temporary ones."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and ".tmp" not in str(path.relative_to(folder))
    }


@cache
def shape_bytes(name: str) -> bytes:
    """A small mesh as STL: box, tube or two."""
    import trimesh

    ball = trimesh.creation.icosphere().apply_translation((1, 1, 1))
    shapes = {
        "box": lambda: trimesh.creation.box((1, 2, 3)),
        "tube": lambda: trimesh.creation.annulus(0.4, 1.0, 0.7),
        "two": lambda: trimesh.util.concatenate([trimesh.creation.box((1, 2, 3)), ball]),
    }
    return bytes(shapes[name]().export(file_type="stl"))


def mesh_in(folder: Path, name: str = "box") -> Path:
    """Write one of these shapes."""
    path = folder / f"{name}.stl"
    path.write_bytes(shape_bytes(name))
    return path
