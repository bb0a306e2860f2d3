"""`resfit view`: pictures without a window, and one plain sentence where something is wrong."""

from __future__ import annotations

import json
import os
import sys
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from viewer_scenes import chain, need_drawing

from resfit.cli import main
from resfit.viewer.model.documents import open_documents
from resfit.viewer.scene import opengl_check
from resfit.viewer.scene.opengl_check import finish_child, start_child


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder like that of a fit, and the mesh that it names beside it."""
    folder = tmp_path / "chain.resfit"
    folder.mkdir()
    chain().save(folder / "assembly.json")
    chain().to_mesh(48).export(tmp_path / "chain.ply")
    digest = sha256((tmp_path / "chain.ply").read_bytes()).hexdigest()
    report = {"format": "resfit-report", "input": {"name": "chain.ply", "sha256": digest}}
    (folder / "report.json").write_text(json.dumps(report))
    return folder


def view(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str]:
    code = main(["view", *map(str, arguments)])
    output = capsys.readouterr()
    assert output.out == ""
    return code, output.err


def test_a_picture_shows_the_assembly_and_what_is_asked_for(
    folder: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    need_drawing()
    pictures = []
    for show in ("", "parts,plain,ghost,labels,x"):
        path = tmp_path / "a.png"
        code, said = view(capsys, folder, "--screenshot", path, "--size", "320x200", "--show", show)
        assert (code, said) == (0, "")
        pictures.append(np.asarray(Image.open(path)))
        assert pictures[-1].shape == (200, 320, 3) and pictures[-1].std() > 10.0
    assert (pictures[0] != pictures[1]).any()


def test_the_mesh_of_a_fit_is_found_unless_it_has_changed(folder: Path, tmp_path: Path) -> None:
    document = open_documents([folder])[0]
    assert (document.title, document.mesh) == ("chain", tmp_path / "chain.ply")
    assert open_documents([folder / "assembly.json"])[0].mesh == tmp_path / "chain.ply"
    (tmp_path / "chain.ply").write_bytes(b"something else")
    assert open_documents([folder])[0].mesh is None
    (folder / "report.json").write_text('{"input": []}')
    assert open_documents([folder])[0].mesh is None


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "nothing to view"),
        (["nobody.json"], "cannot read nobody.json"),
        (["."], "holds no assembly.json"),
        (["FOLDER", "--target", "nobody.ply"], "there is no mesh 'nobody.ply'"),
        (["FOLDER", "--screenshot", "a.txt"], "must end in one of .png"),
        (["FOLDER", "--screenshot", "no/a.png"], "there is no folder 'no'"),
        (["FOLDER", "--screenshot", "a.png", "--size", "big"], "--size big is no size"),
        (["FOLDER", "--screenshot", "a.png", "--size", "9x9"], "out of range"),
        (
            ["FOLDER", "--screenshot", "a.png", "--show", "everything"],
            "--show everything: there is no such thing",
        ),
        (["FOLDER", "--screenshot", "a.png", "--elevation", "95"], "--elevation 95 is out of range"),
        (["FOLDER", "--screenshot", "a.png", "--explode", "-1"], "--explode -1 is out of range"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(
    folder: Path,
    arguments: list[str],
    sentence: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(folder.parent)
    monkeypatch.setenv("DISPLAY", "")
    code, said = view(capsys, *(str(folder) if word == "FOLDER" else word for word in arguments))
    assert code == 2 and sentence in said and said.count("\n") == 1
    assert not (folder.parent / "a.png").exists()


def test_layers_without_a_mesh_are_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (folder / "report.json").unlink()
    code, said = view(capsys, folder, "--screenshot", tmp_path / "a.png", "--show", "residual")
    assert code == 2 and "--target MESH" in said


def test_without_a_screen_the_fix_is_named(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    code, said = view(capsys, folder)
    assert code == 2 and "--screenshot FILE" in said and "--web" in said


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("import os; os.kill(os.getpid(), 11)", "crashed (signal 11)"),
        ("raise ImportError('libGL.so.1 is missing')", "libGL.so.1 is missing"),
    ],
    ids=["crash", "error"],
)
def test_where_nothing_can_be_drawn_the_packages_are_named(
    folder: Path,
    code: str,
    reason: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.setattr(opengl_check, "CODE", code)
    result, said = view(capsys, folder, "--screenshot", tmp_path / "a.png")
    assert result == 2 and reason in said and "libx11-6 libegl1 libgl1" in said and "A.html" in said
    assert said.count("\n") == 1


def test_a_child_that_takes_too_long_is_ended() -> None:
    child = start_child("import time; time.sleep(60)")
    with pytest.raises(RuntimeError, match="no answer within"):
        finish_child(child, seconds=0.2)
    assert child.returncode is not None


def test_headless_drawing_needs_no_x_server(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(os, "environ", {})
    assert opengl_check.render_environment(off_screen=True) == {
        "VTK_DEFAULT_OPENGL_WINDOW": "vtkEGLRenderWindow"
    }
    assert opengl_check.render_environment(off_screen=False) == {}
    os.environ["DISPLAY"] = ":0"
    assert opengl_check.render_environment(off_screen=True) == {}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--web", "--play"), "--web and --play do not go together"),
        (("--screenshot", "a.png", "--video", "a.gif"), "--screenshot and --video do not go together"),
        (("--port", "8000"), "need --web"),
        (("--host", "0.0.0.0"), "need --web"),
    ],
)
def test_options_that_do_not_go_together(
    folder: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...], words: str
) -> None:
    code, said = view(capsys, folder, *options)
    assert code == 2 and words in said and said.count("\n") == 1
