"""`resfit eval` as users run it: tables, JSON, exit codes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from resfit.assembly.assembly import Assembly
from resfit.assembly.primitive import Pose, Primitive
from resfit.assembly.transform import Transform
from resfit.cli import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A box, an assembly that is nearly it, another one in other units, and an open sheet."""
    path = tmp_path_factory.mktemp("eval")
    trimesh.creation.box((18.0, 9.0, 9.0)).export(path / "box.stl")
    part = Primitive("cuboid", "a", Pose(), {"size": (1.7, 0.9, 0.9)})
    for name, scale in (("near", 10.0), ("small", 0.01)):
        (path / name).mkdir()
        Assembly((part,), Transform(scale)).save(path / name / "assembly.json")
    sheet = trimesh.Trimesh(
        [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], process=False
    )
    sheet.export(path / "sheet.ply")
    return path


def run(*arguments: str | Path) -> int:
    return main(["eval", *map(str, arguments)])


def test_json_has_the_keys_of_the_tables(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(folder / "near", folder / "box.stl", "--json") == 0
    shown = capsys.readouterr()
    row = json.loads(shown.out)
    assert shown.err == ""
    for key in (
        "iou", "bisurf_iou", "bisurf_iou_005", "cd", "cd_floor", "emd", "primitive_count", "overlap", "unoverlap",
        "intra_prim", "inter_prim", "floats", "target_rule",
    ):  # fmt: skip
        assert key in row
    assert row["iou"] == pytest.approx(1.7 / 1.8, abs=0.02) and row["target_kind"] == "closed"


def test_table_names_what_was_measured(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(folder / "near" / "assembly.json", folder / "box.stl", "--no-emd") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("target  Closed")
    shown = [line.split("  ")[0].strip() or line.strip().split("  ")[0] for line in lines[1:]]
    assert shown[0] == "IoU" and "BiSurfIoU" in shown and "floats" in shown
    assert not any("earth" in line or "IntraPrim" in line for line in lines)


def test_other_units_are_said_on_stderr(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(folder / "small", folder / "box.stl", "--no-emd", "--json") == 0
    shown = capsys.readouterr()
    assert "probably different frames or units" in shown.err and json.loads(shown.out)["iou"] < 0.01
    assert run(folder / "small", folder / "box.stl", "--no-emd", "--json", "--align", "bbox") == 0
    assert json.loads(capsys.readouterr().out)["iou"] > 0.8


def test_open_target_leads_with_distances(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(folder / "box.stl", folder / "sheet.ply", "--no-emd") == 0
    lines = capsys.readouterr().out.splitlines()
    assert "shell" in lines[0] and "open mesh" in lines[1] and lines[2].strip().startswith("mean distance")


def test_features_of_a_command(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = "import sys, numpy; numpy.save(sys.argv[2], numpy.load(sys.argv[1]))"
    command = f'{sys.executable} -c "{code}" {{points}} {{out}}'
    assert run(folder / "near", folder / "box.stl", "--no-emd", "--json", "--features", command) == 0
    row = json.loads(capsys.readouterr().out)
    assert row["intra_prim"] == pytest.approx(1.0, abs=0.05) and row["inter_prim"] == 0.0


@pytest.mark.parametrize(
    ("prediction", "target", "sentence"),
    [
        ("missing.json", "box.stl", "missing.json"),
        ("missing.glb", "box.stl", "there is no file"),
        ("near", "missing.stl", "there is no file"),
        ("broken.glb", "box.stl", "broken.glb"),
        ("near", "notes.md", "no mesh format"),
        ("empty", "box.stl", "assembly.json"),
    ],
)
def test_unreadable_input(
    folder: Path, capsys: pytest.CaptureFixture[str], prediction: str, target: str, sentence: str
) -> None:
    (folder / "broken.glb").write_bytes(b"glTF nonsense")
    (folder / "notes.md").write_text("# Notes\n")
    (folder / "empty").mkdir(exist_ok=True)
    assert run(folder / prediction, folder / target) == 2
    shown = capsys.readouterr()
    assert shown.out == "" and sentence in shown.err
    assert shown.err.count("\n") == 1 and shown.err.startswith("resfit: ")


def test_bad_usage(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(folder / "near") == 2
    assert run(folder / "near", folder / "box.stl", "--align", "pca") == 2
    assert run(folder / "near", folder / "box.stl", "--features", "nothing", "--no-emd") == 2
    assert "no package here registers one" in capsys.readouterr().err


def test_nothing_but_json_on_stdout(folder: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "resfit",
        "eval",
        str(folder / "near"),
        str(folder / "box.stl"),
        "--json",
    ]
    done = subprocess.run([*command, "--no-emd"], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0 and np.isfinite(json.loads(done.stdout)["iou"])
