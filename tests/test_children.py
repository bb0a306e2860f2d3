"""Child processes of ours: no Python file of the current folder is executed, whichever command runs there."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import trimesh

from resfit.children import python_command
from resfit.viewer.scene.opengl_check import finish_child, start_child

RESFIT = [str(Path(sys.executable).with_name("resfit"))]

PLANTED = (
    "numpy", "scipy", "trimesh", "warp", "pydantic", "pyvista", "vtk", "vtkmodules", "playwright", "PIL", "rich",
    "cyclopts", "matplotlib", "lxml", "networkx", "queue", "random", "json", "pickle", "subprocess", "tempfile",
    "zipfile", "logging", "hashlib", "ctypes", "statistics", "sitecustomize", "usercustomize",
)  # fmt: skip
"""Names that people give to files of their own, and that a hostile archive would choose."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a mesh and files that tell when they are executed."""
    trimesh.creation.box((1.0, 2.0, 3.0)).export(tmp_path / "box.stl")
    for name in PLANTED:
        (tmp_path / f"{name}.py").write_text(
            f"open({str(tmp_path / 'executed')!r}, 'a').write('{name} ')\nraise ImportError('planted')\n"
        )
    return tmp_path


@pytest.fixture
def run(folder: Path) -> Callable[..., int]:
    """Runs a command in the folder, and returns its exit code if nothing of the folder was executed."""

    def run_there(command: list[str], arguments: str) -> int:
        done = subprocess.run(
            [*command, *arguments.split()],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, "PYTHONPATH": ""},
            timeout=300,
        )
        marker = folder / "executed"
        assert (marker.read_text() if marker.exists() else "") == ""
        assert "planted" not in done.stdout + done.stderr
        return done.returncode

    return run_there


FIT = "fit box.stl -o fit --preset fast --max-primitives 1 --progress none"


@pytest.mark.parametrize("command", [RESFIT, [sys.executable, "-m", "resfit"]])
def test_fit_executes_nothing_of_the_current_folder(command: list[str], run: Callable[..., int]) -> None:
    assert run(command, FIT) == 0


def test_a_module_of_the_folder_called_resfit_is_not_executed(folder: Path, run: Callable[..., int]) -> None:
    (folder / "resfit.py").write_text(f"open({str(folder / 'executed')!r}, 'a').write('resfit ')\n")
    assert run(RESFIT, FIT) == 0
    assert run(RESFIT, "export fit/assembly.json fit.obj") == 0


def test_code_of_a_child_imports_nothing_of_the_current_folder(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    assert finish_child(start_child("import numpy, queue; print(numpy.ones(3).sum())")) == "3.0"
    assert not (folder / "executed").exists()
    assert python_command("-c", "pass")[:2] == [sys.executable, "-P"]


@pytest.mark.slow
def test_no_command_executes_anything_of_the_current_folder(run: Callable[..., int]) -> None:
    assert run(RESFIT, FIT) == 0
    for arguments in (
        "eval fit box.stl --no-emd",
        "export fit/assembly.json fit.glb fit.html",
        "gallery box.stl -o page --preset fast",
        "compare box.stl -o compared --methods mps --no-emd",
        "bench fit box.stl --preset fast --repeats 1",
        "demo -o demo --preset fast",
    ):
        assert run(RESFIT, arguments) == 0, arguments
    # These need what not every machine has.
    for arguments in (
        "view fit --screenshot x.png --size 64x64",
        "view fit --video x.gif --seconds 1",
        "doctor",
    ):
        run(RESFIT, arguments)
