"""Every command and every block of Python in README.md, as it is written there.

What needs a screen, serves until it is stopped, or takes many minutes is only parsed; `make` only says what it would
do.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest
import trimesh
from cyclopts import MissingArgumentError
from viewer_scenes import need_drawing

import resfit.cli

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
BINARIES = Path(sys.executable).parent

SECONDS = 600


def blocks(language: str) -> list[str]:
    """The blocks of code in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.DOTALL | re.MULTILINE)


def inline() -> list[str]:
    """What stands between backticks within the text, in one line each."""
    text = re.sub(r"^```.*?^```", "", README, flags=re.DOTALL | re.MULTILINE)
    return [" ".join(code.split()).replace("\\|", "|") for code in re.findall(r"`([^`]+)`", text)]


LINES = [line.partition("#")[0].strip() for block in blocks("sh") for line in block.splitlines()]
MAKE = [line for line in LINES if line.startswith("make ")]
COMMANDS = [line for line in LINES if line.startswith("resfit ")]
EXAMPLES = [code for code in inline() if code.startswith(".venv/bin/python ")]


def is_only_parsed(line: str) -> bool:
    """Whether a command opens a window, serves a page, or takes many minutes."""
    opens = line.startswith("resfit view ") and not re.search("--(screenshot|video) ", line)
    return opens or "--view" in line or "ablation" in line


def is_slow(line: str) -> bool:
    """Whether a command takes long."""
    return line.startswith(
        ("resfit bench", "resfit gallery", "resfit view", "resfit doctor", "resfit fit a.glb b.glb")
    )


RUN = [
    pytest.param(line, marks=[pytest.mark.slow] if is_slow(line) else [])
    for line in COMMANDS
    if not is_only_parsed(line)
]


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the commands of README.md name: meshes, and the fits of some."""
    folder = tmp_path_factory.mktemp("readme")
    seat, back = trimesh.creation.box((0.5, 0.5, 0.1)), trimesh.creation.box((0.5, 0.1, 0.6))
    scene = trimesh.Scene({"seat": seat, "back": back.apply_translation((0.0, 0.2, 0.35))})
    for name in ("chair", "a", "b"):
        scene.export(folder / f"{name}.glb")
    (folder / "meshes").mkdir()
    seat.export(folder / "meshes" / "seat.stl")
    assert resfit.cli.main(["fit", str(folder / "a.glb"), "-o", str(folder / "chair.resfit"), "-q"]) == 0
    shutil.copytree(folder / "chair.resfit", folder / "a.resfit")
    shutil.copytree(folder / "chair.resfit", folder / "fits" / "old.resfit")
    for name in ("a", "b"):
        shutil.copy(folder / "chair.resfit" / "assembly.json", folder / f"{name}.json")
    return folder


@pytest.fixture
def place(fitted: Path, tmp_path: Path) -> Path:
    """A copy of that folder, so that no command sees what another one left; `.venv` is that of this Python."""
    folder = tmp_path / "place"
    shutil.copytree(fitted, folder)
    (folder / ".venv").symlink_to(sys.prefix)
    return folder


def run(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A line of shell in a folder, with the commands of this Python; browsers open nothing."""
    variables = {"PATH": f"{BINARIES}{os.pathsep}{os.environ['PATH']}", "BROWSER": "true"}
    return subprocess.run(
        ["bash", "-c", line],
        cwd=folder,
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        check=False,
        timeout=SECONDS,
    )


def files_below(folder: Path) -> dict[Path, int]:
    """Files, and when each was written last."""
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("line", RUN)
def test_commands_run(line: str, place: Path) -> None:
    if ".mp4" in line and find_spec("imageio_ffmpeg") is None:
        pytest.skip("imageio-ffmpeg (extra video) is not installed")
    if line.startswith("resfit view"):
        need_drawing()
    before = files_below(place)
    done = run(line, place)
    assert done.returncode == 0, done.stderr
    # Measuring and asking write nothing.
    assert (files_below(place) == before) == line.startswith(("resfit bench", "resfit doctor"))


def test_the_environment_can_be_entered(place: Path) -> None:
    (line,) = [line for line in LINES if line.startswith("source ")]
    if not (place / ".venv" / "bin" / "activate").exists():
        pytest.skip("this Python is in no virtual environment")
    done = run(f"{line} && command -v resfit", place)
    assert done.returncode == 0 and done.stdout.strip().endswith("bin/resfit")


def test_every_line_is_known() -> None:
    assert [line for line in LINES if not line.startswith(("make ", "resfit ", "source ")) and line] == []
    assert len(COMMANDS) > 15 and len(RUN) > 8 and EXAMPLES and MAKE


@pytest.mark.parametrize("line", [*COMMANDS, *(code for code in inline() if code.startswith("resfit "))])
def test_commands_have_options_that_exist(line: str) -> None:
    words = [word for word in shlex.split(line)[1:] if word != resfit.cli.HELP_ALL]
    app = resfit.cli.build_app()
    assert words[0] in app
    try:
        app.parse_args(words, exit_on_error=False, print_error=False)
    except MissingArgumentError:
        # In the text a command may stand without what it works on.
        assert line not in COMMANDS


def test_options_and_extras_in_the_text_exist() -> None:
    known = resfit.cli.build_app(everything=True).generate_completion(shell="bash")
    for code in inline():
        if code.startswith("-"):
            option = code.split()[0]
            assert re.search(rf"(?<![\w-]){re.escape(option)}(?![\w-])", known), code
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    named = set(re.findall(r"extra\s+`(\w+)`", README))
    assert named and named <= set(extras)


@pytest.mark.parametrize("line", MAKE)
def test_make_has_these_targets(line: str) -> None:
    done = run(line.replace("make ", "make -n ", 1), ROOT)
    assert done.returncode == 0 and "resfit" in done.stdout, done.stderr


@pytest.mark.parametrize("block", blocks("python"))
def test_python_runs(block: str, place: Path) -> None:
    (place / "block.py").write_text(block)
    done = run("python block.py", place)
    assert (done.returncode, done.stderr) == (0, "")
    assert (place / "chair.obj").exists()


@pytest.mark.parametrize("line", EXAMPLES)
def test_examples_run(line: str, place: Path) -> None:
    (place / "examples").symlink_to(ROOT / "examples")
    done = run(line, place)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_page_of_a_notebook_needs_no_other_import() -> None:
    assert any("resfit.viewer.web.show(assembly)" in code for code in inline())
    code = (
        "import inspect, sys, resfit; assert 'resfit.viewer' not in sys.modules;"
        "assert inspect.iscoroutinefunction(resfit.viewer.web.show)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_the_summary_looks_as_it_is_shown(place: Path) -> None:
    command, *shown = blocks("text")[0].splitlines()
    shutil.copy(ROOT / "src" / "resfit" / "data" / "potted_cactus.glb", place)
    done = run(command.removeprefix("$ "), place)
    found = done.stdout.splitlines()
    assert (done.returncode, done.stderr) == (0, "")
    assert [line[:11] for line in found] == [line[:11] for line in shown]
    assert found[-2:] == shown[-2:]
    plain = [re.sub(r"[\d.]+", "0", lines[0]) for lines in (found, shown)]
    assert plain[0] == plain[1]
