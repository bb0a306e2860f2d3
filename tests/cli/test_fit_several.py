"""`resfit fit` of several meshes, what is refused before anything is loaded, and how quiet it is."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import webbrowser
from pathlib import Path

import pytest
import trimesh

import resfit.cli
from resfit.cli.several import own_folders
from resfit.errors import InputError

FAST = ["--preset", "fast", "--device", "cpu"]


@pytest.fixture
def boxes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with two boxes and a file that is no mesh."""
    monkeypatch.chdir(tmp_path)
    trimesh.creation.box((1.0, 2.0, 3.0)).export("tall.stl")
    trimesh.creation.box((2.0, 2.0, 1.0)).export("flat.ply")
    Path("bad.obj").write_text("shopping list\n")
    return tmp_path


def test_each_mesh_gets_its_folder_and_a_bad_one_stops_nothing(
    boxes: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert resfit.cli.main(["fit", "tall.stl", "bad.obj", "flat.ply", *FAST, "-o", "fits"]) == 3
    captured = capsys.readouterr()
    assert [line for line in captured.out.splitlines() if line[0] != " "] == [
        line
        for line in captured.out.splitlines()
        if line.startswith(("tall.stl: 1 part", "flat.ply: 1 part"))
    ]
    first, last = captured.err.splitlines()
    assert "'bad.obj'" in first and last == "resfit: 1 of 3 meshes was not fitted: 'bad.obj'."
    assert sorted(path.name for path in (boxes / "fits").iterdir()) == ["flat.resfit", "tall.resfit"]
    assert resfit.cli.main(["fit", "flat.ply", "-q", *FAST]) == 0
    assert capsys.readouterr() == ("", "")
    alone, among = (
        Path(folder, "assembly.json").read_bytes() for folder in ("flat.resfit", "fits/flat.resfit")
    )
    assert alone == among


def test_a_signal_ends_all(boxes: Path) -> None:
    command = [sys.executable, "-m", "resfit", "fit", "tall.stl", "flat.ply", "--progress", "json", *FAST]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if json.loads(line).get("stage") == "decompose":
                break
        process.send_signal(signal.SIGINT)
        rest = process.stderr.read()
    assert process.returncode == 4
    assert '"mesh": "flat.ply"' not in rest and not (boxes / "flat.resfit").exists()
    assert "resfit: stopped; " in rest and "'flat.ply'" in rest and "Traceback" not in rest


def test_meshes_that_would_share_a_folder_are_refused() -> None:
    assert own_folders([Path("a/x.stl"), Path("y.obj")], Path("out")) == {
        Path("a/x.stl"): Path("out/x.resfit"),
        Path("y.obj"): Path("out/y.resfit"),
    }
    for meshes, part in (
        (["a/x.stl", "b/x.obj"], "would both be written"),
        (["x.stl", "X.stl"], "would both"),
        (["x.stl", "x.stl"], "is given twice"),
    ):
        with pytest.raises(InputError, match=part):
            own_folders([Path(mesh) for mesh in meshes], Path())


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["missing.glb"], "there is no file"),
        (["tall.stl", "missing.glb"], "there is no file"),
        (
            ["sub"],
            "is a folder with 2 meshes in it; call resfit fit sub/*.obj sub/*.stl, or resfit gallery sub",
        ),
        (["empty"], "is a folder without a mesh"),
        (["old.resfit"], "is the folder of a fit; call resfit view old.resfit"),
        (["tall.stl", "-o", "bad.obj/x"], "cannot write to"),
        (["tall.stl", "flat.ply", "-o", "bad.obj"], "cannot write to"),
        (["tall.stl", "flat.ply", "--view"], "--view goes with one mesh only"),
        (["tall.stl", "flat.ply", "--open"], "--open goes with one mesh only"),
        (["tall.stl", "flat.ply", "--init", "old.resfit"], "--init goes with one mesh only"),
        (["tall.stl", "--tolerance", "0"], "--tolerance 0 is out of range; it must be above 0."),
        (["tall.stl", "--tolerance", "-1"], "it must be above 0."),
    ],
)
def test_what_cannot_be_fitted_is_refused_before_anything_heavy_is_loaded(
    arguments: list[str], part: str, boxes: Path
) -> None:
    for folder in ("sub", "empty", "old.resfit"):
        (boxes / folder).mkdir()
    for name in ("a.obj", "b.stl", "c.txt"):
        (boxes / "sub" / name).write_text("x")
    (boxes / "old.resfit" / "report.json").write_text('{"format": "resfit-report"}')
    code = (
        f"import sys, resfit.cli\ncode = resfit.cli.main({['fit', *arguments]!r})\n"
        "assert not {'warp', 'trimesh', 'numpy', 'scipy'} & set(sys.modules), 'heavy'\nsys.exit(code)"
    )
    before = sorted(boxes.rglob("*"))
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 2 and done.stdout == ""
    assert part in done.stderr and done.stderr.count("\n") == 1
    assert sorted(boxes.rglob("*")) == before


def test_an_option_that_fits_no_mesh_is_said_once(boxes: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert resfit.cli.main(["fit", "tall.stl", "flat.ply", "--target-iou", "2"]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1 and "--target-iou 2" in captured.err


def test_open_shows_the_page_or_says_where_it_is(
    boxes: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda address: opened.append(address) or len(opened) == 1)
    for expected in ("", "resfit: there is no browser here; the page is tall.resfit/viewer.html.\n"):
        assert resfit.cli.main(["fit", "tall.stl", "-q", "--open", *FAST]) == 0
        assert capsys.readouterr() == ("", expected)
    assert opened == [(boxes / "tall.resfit" / "viewer.html").as_uri()] * 2


def test_an_empty_file_is_one_failure_and_a_missing_one_stops_all(
    boxes: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (boxes / "empty.stl").touch()
    assert resfit.cli.main(["fit", "empty.stl", "flat.ply", "-q", *FAST]) == 3
    assert "1 of 2 meshes was not fitted: 'empty.stl'" in capsys.readouterr().err
    assert (boxes / "flat.resfit").is_dir()
    assert resfit.cli.main(["fit", "missing.stl", "tall.stl", "-q", *FAST]) == 2
    assert not (boxes / "tall.resfit").exists()
