"""`resfit fit` and `resfit demo`: files, exit codes, interrupts, and the same bytes every time."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import trimesh

import resfit.cli
from resfit.assembly.assembly import Assembly

FILES = ["assembly.json", "history.npz", "parts.glb", "preview.png", "report.json", "viewer.html"]


@pytest.fixture(scope="module")
def meshes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a box and a torus."""
    folder = tmp_path_factory.mktemp("meshes")
    trimesh.creation.box((1.0, 2.0, 3.0)).export(folder / "box.stl")
    trimesh.creation.torus(1.0, 0.25).export(folder / "torus.ply")
    return folder


def run(*arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
    """`resfit` in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "resfit", *map(str, arguments)],
        capture_output=True,
        text=True,
        env={**os.environ, **environment},
        check=False,
        timeout=120,
    )


def test_fit_of_a_box(
    meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert resfit.cli.main(["fit", str(meshes / "box.stl"), "--preset", "fast", "--device", "cpu"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    first, *_ = captured.out.splitlines()
    assert first.startswith("box.stl: 1 part, IoU 1.000, 95 % of the surface within")
    assert "mesh of 1 body" in captured.out and "box.resfit" in captured.out
    assert sorted(path.name for path in (tmp_path / "box.resfit").iterdir()) == FILES
    (part,) = Assembly.load(tmp_path / "box.resfit" / "assembly.json").primitives
    assert part.name == "part_00"


def test_same_bytes_every_time_and_on_any_number_of_cores(meshes: Path, tmp_path: Path) -> None:
    contents = []
    for name, threads in (("one", "1"), ("two", "2"), ("three", "2")):
        folder = tmp_path / name
        done = run("fit", meshes / "torus.ply", "-o", folder, "--preset", "fast", RESFIT_THREADS=threads)
        assert (done.returncode, done.stderr) == (0, "")
        contents.append([(folder / file).read_bytes() for file in ("assembly.json", "history.npz")])
    assert contents[0] == contents[1] == contents[2]
    text = contents[0][0].decode()
    assert str(tmp_path) not in text and str(meshes) not in text


def test_fitting_never_imports_vtk(meshes: Path, tmp_path: Path) -> None:
    arguments = ["fit", str(meshes / "box.stl"), "-o", str(tmp_path / "fit"), "--preset", "fast"]
    code = (
        f"import sys, resfit.cli\nassert resfit.cli.main({arguments!r}) == 0\n"
        "assert not {'vtk', 'vtkmodules', 'pyvista'} & set(sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=120
    )
    assert (done.returncode, done.stderr.strip()) == (0, "")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupt_keeps_the_best_so_far(number: int, meshes: Path, tmp_path: Path) -> None:
    folder = tmp_path / "fit"
    command = [sys.executable, "-m", "resfit", "fit", str(meshes / "torus.ply"), "-o", str(folder)]
    command += ["--preset", "best", "--parsimony", "0", "--progress", "json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None and process.stdout is not None
        for line in process.stderr:
            if line.startswith("{") and json.loads(line).get("primitive_count"):
                break
        process.send_signal(number)
        events = [json.loads(line) for line in process.stderr if line.startswith("{")]
        summary = process.stdout.read()
    assert process.returncode == 4
    assert [event["event"] for event in events][-2:] == ["writing", "done"]
    assert events[-1]["exit_code"] == 4
    assert sorted(path.name for path in folder.iterdir()) == FILES
    assert len(Assembly.load(folder / "assembly.json").primitives) >= 1
    assert "interrupted; this is the best so far" in summary
    assert json.loads((folder / "report.json").read_text())["status"]["stopped_early"] is True


def test_a_fit_stopped_before_a_part_is_found_writes_nothing(
    meshes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["fit", str(meshes / "box.stl"), "-o", str(tmp_path / "fit"), "--device", "cpu"]
    assert resfit.cli.main([*arguments, "--timeout", "0.001"]) == 4
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.endswith("before a part was found, so nothing was written.\n")
    assert not (tmp_path / "fit").exists()
    assert resfit.cli.main([*arguments, "--preset", "fast"]) == 0
    before = (tmp_path / "fit" / "report.json").read_bytes()
    capsys.readouterr()
    assert resfit.cli.main([*arguments, "--timeout", "0.001"]) == 4
    captured = capsys.readouterr()
    assert captured.out == "" and "is as it was" in captured.err
    assert (tmp_path / "fit" / "report.json").read_bytes() == before


def test_the_summary_says_what_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = Path(__file__).parents[1] / "data" / "field_inputs" / "drilled_plate.obj"
    assert resfit.cli.main(["fit", str(source), "-o", str(tmp_path / "fit"), "--preset", "fast"]) == 0
    text = capsys.readouterr().out
    report = json.loads((tmp_path / "fit" / "report.json").read_text())
    kept = 4 - report["metrics"]["filled_holes"]
    assert kept == 4 or f"left out {4 - kept} through-hole" in text
    assert " % of the size)" in text and "resfit view " in text


def test_an_empty_assembly_is_no_result(
    meshes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["fit", str(meshes / "torus.ply"), "-o", str(tmp_path / "fit"), "--preset", "fast"]
    assert resfit.cli.main([*arguments, "--parsimony", "0.99"]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and "no part raised the objective for 'torus.ply'" in captured.err
    assert not (tmp_path / "fit").exists()


def test_a_speck_far_away_does_not_hide_the_shape(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    box = trimesh.creation.box()
    speck = trimesh.Trimesh([(400, 0, 0), (400, 0.1, 0), (400, 0, 0.1)], [[0, 1, 2]], process=False)
    trimesh.util.concatenate([box, speck]).export(tmp_path / "far.stl")
    arguments = ["fit", str(tmp_path / "far.stl"), "-o", str(tmp_path / "fit"), "--preset", "fast"]
    assert resfit.cli.main(arguments) == 0
    assert "1 face, 400 or more away from the rest" in capsys.readouterr().out
    report = json.loads((tmp_path / "fit" / "report.json").read_text())
    assert report["metrics"]["iou"] > 0.95 and report["input"]["reader"]


def test_progress_as_json_lines(meshes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["fit", str(meshes / "box.stl"), "-o", str(tmp_path / "fit"), "--device", "cpu"]
    assert resfit.cli.main([*arguments, "--preset", "fast", "--progress", "json"]) == 0
    events = [json.loads(line) for line in capsys.readouterr().err.splitlines()]
    names = [event["event"] for event in events]
    assert names[0] == "start" and names[-2:] == ["writing", "done"]
    assert {"stage", "round", "iou", "primitive_count", "fraction", "elapsed_s", "left_s"} <= set(events[-3])
    assert events[-1] == {
        "event": "done",
        "elapsed_s": events[-1]["elapsed_s"],
        "status": events[-1]["status"],
        "exit_code": 0,
        "directory": str(tmp_path / "fit"),
    }


@pytest.mark.parametrize(
    ("name", "content", "part"),
    [
        ("missing.obj", None, "there is no file"),
        ("empty.glb", b"", "is empty"),
        ("text.obj", b"shopping list\n", "holds no faces"),
        ("points.obj", b"v 0 0 0\nv 1 0 0\n", "no faces"),
        ("mesh.doc", b"v 0 0 0\n", "no mesh format"),
        ("broken.glb", b"\x00\x01\x02", "is no GLB file"),
        ("nan.obj", b"v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n", "not finite"),
        (".", None, "is a folder"),
    ],
)
def test_bad_input_is_one_sentence_and_nothing_written(
    name: str, content: bytes | None, part: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    before = sorted(tmp_path.iterdir())
    assert resfit.cli.main(["fit", str(path), "-o", str(tmp_path / "fit"), "--device", "cpu"]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1 and part in captured.err
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["-o", "DIR"], "is not empty"),
        (["-o", "DIR/file.txt"], "is no folder"),
        (["-o", "DIR/file.txt/fit"], "cannot write to"),
        (["--preset", "slow"], "--preset"),
        (["--max-primitives", "0"], "--max-primitives 0"),
        (["--target-iou", "2"], "--target-iou 2"),
        (["--tolerance", "nan"], "--tolerance"),
        (["--primitive", "blob"], "--primitive blob"),
        (["--device", "tpu"], "device 'tpu'"),
        (["--init", "DIR/missing.json"], "cannot read"),
    ],
)
def test_usage_errors(
    arguments: list[str], part: str, meshes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file.txt").write_text("mine")
    options = [text.replace("DIR", str(tmp_path)) for text in arguments]
    if "-o" not in options:
        options += ["-o", str(tmp_path / "fit")]
    assert resfit.cli.main(["fit", str(meshes / "box.stl"), *options]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1 and part in captured.err
    assert [path.name for path in tmp_path.iterdir()] == ["file.txt"]


def test_help_all_shows_more(capsys: pytest.CaptureFixture[str]) -> None:
    assert resfit.cli.main(["fit", "--help-all"]) == 0
    assert "--parsimony" in capsys.readouterr().out
    assert resfit.cli.main(["fit", "--help"]) == 0
    text = capsys.readouterr().out
    assert "--parsimony" not in text and "--max-primitives" in text and "--help-all" in text


def test_demo(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["demo", "-o", str(tmp_path / "demo"), "--preset", "fast", "--device", "cpu"]
    assert resfit.cli.main(arguments) == 0
    assert capsys.readouterr().out.startswith("potted_cactus.glb: ")
    assert json.loads((tmp_path / "demo" / "report.json").read_text())["metrics"]["iou"] > 0.85
