"""The command line: exit codes, one sentence on stderr, nothing but JSON where JSON was asked for."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

import resfit.cli
from resfit.assembly.assembly import Assembly
from resfit.assembly.primitive import Pose, Primitive
from resfit.cli import checks
from resfit.extras import command_for, requirements

PYPROJECT = Path(__file__).parents[2] / "pyproject.toml"
EXTRAS: dict[str, list[str]] = tomllib.loads(PYPROJECT.read_text())["project"]["optional-dependencies"]


@pytest.fixture
def assembly_path(tmp_path: Path) -> Path:
    path = tmp_path / "box.json"
    Assembly((Primitive("cuboid", "box", Pose(), {"size": (1.0, 0.5, 0.5)}),)).save(path)
    return path


def complaint(capsys: pytest.CaptureFixture[str]) -> str:
    """What went to stderr, which is one line; nothing went to stdout."""
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("resfit: ") and captured.err.count("\n") == 1
    return captured.err.removeprefix("resfit: ").strip()


def test_export(assembly_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outputs = [tmp_path / "box.glb", tmp_path / "box.obj"]
    arguments = ["export", str(assembly_path), *map(str, outputs), "--resolution", "8", "--device", "cpu"]
    assert resfit.cli.main(arguments) == 0
    assert all(path.stat().st_size > 100 for path in outputs)
    assert capsys.readouterr().out == ""


def test_the_folder_of_a_fit_stands_for_its_assembly(assembly_path: Path, tmp_path: Path) -> None:
    assembly_path.rename(tmp_path / "assembly.json")
    assert resfit.cli.main(["export", str(tmp_path), str(tmp_path / "box.obj"), "--resolution", "8"]) == 0
    assert (tmp_path / "box.obj").stat().st_size > 100


@pytest.mark.parametrize("command", [["view", "MESH"], ["export", "MESH", "DIR/a.glb"]])
def test_a_mesh_in_the_place_of_an_assembly(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my chair.obj").write_text("v 0 0 0\n")
    assert resfit.cli.main([text.replace("MESH", "my chair.obj") for text in command]) == 2
    assert complaint(capsys) == (
        "'my chair.obj' is a mesh, not an assembly; call resfit fit 'my chair.obj' first, and then give"
        " 'my chair.resfit'."
    )


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["exprt"], "Unknown command"),
        (["export"], "requires an argument"),
        (["export", "BOX"], "at least one file"),
        (["export", "BOX", "a.xyz"], "must end in one of"),
        (["export", "BOX", "missing/a.glb"], "there is no folder"),
        (["export", "missing.json", "DIR/a.glb"], "No such file"),
        (["export", "DIR", "DIR/a.glb"], "holds no assembly.json"),
        (["export", "BOX", "DIR/a.glb", "--resolution", "many"], "unable to convert"),
        (["export", "BOX", "DIR/a.glb", "--resolution", "-1"], "resolution is -1"),
        (["export", "BOX", "DIR/a.glb", "--device", "tpu"], "device 'tpu' is not available"),
        (["export", "BOX", "DIR/a.glb", "--nonsense"], "Unknown option"),
        (["bench", "nonsense"], "Invalid value"),
        (["--nonsense"], "nonsense"),
        (["two\nlines"], "Unknown command"),
    ],
)
def test_usage_errors(
    arguments: list[str],
    part: str,
    assembly_path: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    arguments = [text.replace("BOX", str(assembly_path)).replace("DIR", str(tmp_path)) for text in arguments]
    assert resfit.cli.main(arguments) == 2
    assert part in complaint(capsys)
    assert list(tmp_path.iterdir()) == [assembly_path]


@pytest.mark.parametrize(
    ("arguments", "command"),
    [
        (["exprt"], "resfit"),
        (["fit"], "resfit fit"),
        (["fit", "a.glb", "--nonsense"], "resfit fit"),
        (["fit", "a.glb", "--preset", "slow"], "resfit fit"),
        (["bench", "nonsense"], "resfit bench"),
    ],
)
def test_usage_errors_name_the_help_of_the_command(
    arguments: list[str], command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert resfit.cli.main(arguments) == 2
    assert complaint(capsys).endswith(f" See {command} --help.")


def test_help_and_version_by_other_names(capsys: pytest.CaptureFixture[str]) -> None:
    for other, usual in (("help", "--help"), ("help fit", "fit --help"), ("-V", "--version")):
        assert resfit.cli.main(other.split()) == resfit.cli.main(usual.split()) == 0
        text = capsys.readouterr().out
        assert text and text[: len(text) // 2] == text[len(text) // 2 :]
    assert resfit.cli.main(["help", "nonsense"]) == 2
    assert complaint(capsys) == "there is no command nonsense; resfit help lists all."


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_knows_commands_and_options(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert resfit.cli.main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(word in script for word in ("resfit", "gallery", "max-primitives", "balanced"))


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_bash_completes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert resfit.cli.main(["completion", "bash"]) == 0
    script = tmp_path / "resfit.bash"
    script.write_text(capsys.readouterr().out)
    code = (
        f"source {script}; COMP_WORDS=(resfit fit --preset b); COMP_CWORD=3; _resfit; echo ${{COMPREPLY[@]}};"
        "COMP_WORDS=(resfit gal); COMP_CWORD=1; _resfit; echo ${COMPREPLY[@]}"
    )
    done = subprocess.run(["bash", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["balanced", "best", "gallery"]


def test_invalid_assemblies(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bad.json"
    path.write_text('{"format": "resfit-assembly", "version": 1, "primitives": []}')
    assert resfit.cli.main(["export", str(path), str(tmp_path / "a.glb")]) == 2
    assert complaint(capsys) == f"{path}: transform is missing"


def test_defects_write_a_log(
    assembly_path: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(path: object) -> Assembly:
        raise RuntimeError("wheels\nfell off")

    monkeypatch.setattr(Assembly, "load", broken)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert resfit.cli.main(["export", str(assembly_path), str(tmp_path / "a.glb")]) == 1
    sentence = complaint(capsys)
    assert "defect" in sentence and "wheels fell off" in sentence
    (log,) = tmp_path.glob("resfit-*.log")
    assert sentence.endswith(str(log)) and "Traceback" in log.read_text()


def test_interrupt(
    assembly_path: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(path: object) -> Assembly:
        raise KeyboardInterrupt

    monkeypatch.setattr(Assembly, "load", interrupted)
    assert resfit.cli.main(["export", str(assembly_path), str(tmp_path / "a.glb")]) == 4
    assert complaint(capsys) == "stopped."


def test_module_runs_as_a_program() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "resfit", "--version"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.strip() == resfit.__version__
    done = subprocess.run(
        [sys.executable, "-m", "resfit", "export"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2 and "Traceback" not in done.stderr


@pytest.fixture
def no_children(monkeypatch: pytest.MonkeyPatch) -> None:
    """Starting VTK and a browser takes seconds; the real thing is tested with the slow tests."""
    monkeypatch.setattr(checks, "_child", lambda code: "works")


@pytest.mark.usefixtures("no_children")
def test_doctor_json_is_nothing_but_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert resfit.cli.main(["doctor", "--json", "--device", "cpu"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["ok"] is True
    found = {check["name"]: check for check in report["checks"]}
    for name in ("python", "packages", "devices", "kernel cache", "kernels"):
        assert found[name]["ok"] and found[name]["core"]
    assert all(check["fix"] for check in report["checks"] if not check["ok"] and not check["core"])
    # What there is to install is what pyproject.toml offers, and nothing else.
    assert set(checks.PURPOSES) == set(EXTRAS) and set(EXTRAS) < set(found)


@pytest.mark.usefixtures("no_children")
def test_doctor_says_how_to_get_an_extra(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(checks, "version", absent)
    assert resfit.cli.main(["doctor", "--device", "cpu"]) == 1
    text = capsys.readouterr().out
    assert "FAIL  packages" in text and "make install" in text
    for extra, wanted in EXTRAS.items():
        assert requirements(extra) == {re.split(r"\W?[<>=]", line)[0]: line for line in wanted}
        command = command_for(extra)
        assert f"({command})" in text
        assert shlex.split(command)[1:] == ["-m", "pip", "install", *wanted]
    assert "usd" not in text and "mujoco" not in text and "ray " not in text.replace("ray tracer", "")


def absent(package: str) -> str:
    raise PackageNotFoundError(package)


@pytest.mark.usefixtures("no_children")
def test_doctor_says_when_the_core_does_not_work(capsys: pytest.CaptureFixture[str]) -> None:
    assert resfit.cli.main(["doctor", "--device", "tpu"]) == 1
    output = capsys.readouterr().out
    assert "FAIL  devices" in output and "does not work" in output


def test_children_that_crash_or_hang_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RuntimeError, match="crashed"):
        checks._child("import os; os.kill(os.getpid(), 11)")
    with pytest.raises(RuntimeError, match="wheels"):
        checks._child("raise ValueError('wheels')")
    monkeypatch.setattr(checks, "CHILD_SECONDS", 0.2)
    with pytest.raises(RuntimeError, match="no answer"):
        checks._child("import time; time.sleep(9)")


@pytest.mark.slow
def test_doctor_with_everything(capsys: pytest.CaptureFixture[str]) -> None:
    assert resfit.cli.main(["doctor"]) == 0
    assert "ok  kernels" in capsys.readouterr().out


def test_public_names() -> None:
    for name in resfit.__all__:
        assert getattr(resfit, name) is not None
        assert name in dir(resfit)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        resfit.nonsense  # type: ignore[attr-defined]  # noqa: B018
