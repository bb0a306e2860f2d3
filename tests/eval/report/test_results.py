"""Tables and contact sheets of many fits: rows are kept, nothing finished is computed again, no path leaks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from resfit.eval.report import results
from resfit.eval.report.contact_sheet import draw_sheet
from resfit.eval.report.results_table import write_table


def row(mesh: str, **values: Any) -> dict[str, Any]:
    usual = {
        "mesh": mesh, "exit_code": 0, "faces": 12, "closed": True, "kind": "closed", "sentence": "Closed.",
        "notes": [], "iou": 0.9, "overlap": 0.1, "unoverlap": 0.0, "primitive_count": 3, "floats": 52,
        "cpu_s": 4.0, "wall_s": 3.0, "peak_mb": 400.0, "deviation": 0.01, "status": "done",
        "machine": {"device": "cpu", "cores": 2},
    }  # fmt: skip
    return usual | values


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with two meshes and a text."""
    for name in ("b.stl", "a.ply"):
        trimesh.creation.box().export(tmp_path / name)
    (tmp_path / "notes.txt").write_text("no mesh")
    return tmp_path


def test_table(tmp_path: Path) -> None:
    rows = [
        row("a.stl", iou=0.5),
        row("b.stl", iou=0.9),
        row("open.ply", iou=0.1, closed=False, deviation=None, sentence="Open.", notes=["Points left out."]),
        {"mesh": "c.obj", "exit_code": 2, "error": "it is empty."},
    ]
    write_table(rows, tmp_path / "results.md", "fast")
    text = (tmp_path / "results.md").read_text()
    assert "**Closed meshes (2):** mean IoU 0.700, median 0.700, worst 0.500" in text
    shown = text.partition("## The worst")[2].partition("## Closed")[0]
    assert "![each input beside its fit](worst.png)" in shown
    assert (
        shown.index("- a.stl (closed): IoU 0.500")
        < shown.index("- b.stl")
        < shown.index("- open.ply (open):")
    )
    assert "- open.ply (open): no surface, IoU 0.100, 3 parts; done." in shown
    assert "| open.ply | 12 | 0.100 | - | 3 |" in text
    assert "- c.obj: exit code 2, it is empty." in text
    assert "- open.ply: Open. Points left out." in text


def test_contact_sheet(tmp_path: Path) -> None:
    (tmp_path / "a.stl.resfit").mkdir()
    Image.fromarray(np.full((360, 960, 3), 77, np.uint8)).save(tmp_path / "a.stl.resfit" / "preview.png")
    rows = [row("a.stl"), {"mesh": "c.obj", "exit_code": 2, "error": "a long sentence " * 20}]
    draw_sheet(rows, tmp_path, tmp_path / "sheet.png")
    with Image.open(tmp_path / "sheet.png") as sheet:
        pixels = np.asarray(sheet.convert("RGB"))
    assert pixels.shape == (236, 984, 3)
    assert (pixels[100, 100] == 77).all() and (pixels[100, 600] > 200).all()


def test_finished_rows_are_not_computed_again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    work, calls = folder / "work", []

    def fitted(mesh: Path, at: Path, *_: object) -> dict[str, Any]:
        calls.append(mesh.name)
        (at / f"{mesh.name}.resfit").mkdir(exist_ok=True)
        (at / f"{mesh.name}.resfit" / "preview.png").write_bytes(b"")
        return row(mesh.name)

    monkeypatch.setattr(results, "fit_one", fitted)
    monkeypatch.setattr(results, "_warm_up", lambda: None)
    meshes = results.find_meshes([folder])
    assert [path.name for path in meshes] == ["a.ply", "b.stl"]
    first = results.run_all(meshes, work, "fast", 0.0, fresh=False)
    with (work / "rows.jsonl").open("a") as stream:
        stream.write('{"key": "cut off')
    assert results.run_all(meshes, work, "fast", 0.0, fresh=False) == first
    assert calls == ["a.ply", "b.stl"]
    results.run_all(meshes, work, "best", 0.0, fresh=False)
    trimesh.creation.box((1, 1, 2)).export(folder / "b.stl")
    results.run_all(meshes, work, "fast", 0.0, fresh=False)
    assert calls[2:] == ["a.ply", "b.stl", "b.stl"]
    results.run_all(meshes, work, "fast", 0.0, fresh=True)
    assert calls[5:] == ["a.ply", "b.stl"]


def test_row_of_a_fit_and_of_a_refusal(folder: Path) -> None:
    work = folder / "work"
    found = results.fit_one(folder / "b.stl", work, "fast", 0.0)
    assert found["exit_code"] == 0 and found["iou"] > 0.99 and found["closed"] and found["deviation"] < 0.01
    (folder / "empty.obj").touch()
    refused = results.fit_one(folder / "empty.obj", work, "fast", 0.0)
    assert refused["exit_code"] == 2 and refused["error"].startswith("'empty.obj' is empty")
    assert str(folder) not in json.dumps([found, refused])
