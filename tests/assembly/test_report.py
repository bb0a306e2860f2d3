"""report.json as others may have written it: read to the same limits by all that read it."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest
from pages import desk_lamp

from resfit.assembly.assembly import Assembly
from resfit.assembly.plain_json import check_depth, number_at, text_at
from resfit.assembly.report import MAX_BYTES, read_report
from resfit.assembly.worth import part_worths
from resfit.cli import main
from resfit.cli.gallery import fit_command
from resfit.eval.report.gallery import read_entry, thumbnail
from resfit.exports.facts import report_facts
from resfit.result.folder import holds_fit
from resfit.viewer.model.documents import reported_mesh
from resfit.viewer.playback.playback import reported_iou

BEGIN = '{"format": "resfit-report", "x": '


@pytest.mark.parametrize(
    "text",
    [
        "", "[]", '{"format": "another"}', "[" * 100_000, BEGIN + "1e999}", BEGIN + "NaN}", BEGIN + "-Infinity}",
        BEGIN + "1" * 400 + "}", BEGIN + "1" * 5000 + "}", BEGIN + "[" * 40 + "]" * 40 + "}", BEGIN + "\udcff}",
    ],
)  # fmt: skip
def test_what_is_no_report(text: str, tmp_path: Path) -> None:
    (tmp_path / "report.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    assert read_report(tmp_path) == {} and not holds_fit(tmp_path)
    assert read_entry(tmp_path) is None and reported_iou(tmp_path) is None
    assert reported_mesh(tmp_path / "assembly.json") is None


def test_what_is_no_file(tmp_path: Path) -> None:
    assert read_report(tmp_path) == {}
    os.mkfifo(tmp_path / "report.json")
    # Whoever opened a pipe that nobody writes to would wait for ever.
    assert read_report(tmp_path) == {}
    (tmp_path / "report.json").unlink()
    with (tmp_path / "report.json").open("wb") as stream:
        stream.truncate(MAX_BYTES + 1)
    assert read_report(tmp_path) == {}


def test_values_of_other_types_count_as_not_there(tmp_path: Path) -> None:
    values: list[Any] = [None, True, "x", [], {}, [1], {"iou": "x"}]
    for value in values:
        report = {
            "format": "resfit-report",
            "metrics": value,
            "input": value,
            "parts": [value],
            "deviation": value,
        }
        (tmp_path / "report.json").write_text(json.dumps(report))
        found = read_report(tmp_path)
        assert found == report and report_facts(found) == [] and reported_iou(tmp_path) is None
        assert read_entry(tmp_path, fit_command) is not None
        assert part_worths(Assembly(), tmp_path / "assembly.json") == []
    assert number_at({"a": True}, "a") is None and number_at({"a": 10**400}, "a") is None
    assert text_at({"a": {"b": "c"}}, "a", "b") == "c" and text_at({"a": 1}, "a", "b") == ""


def test_halves_of_surrogate_pairs_can_be_written(tmp_path: Path) -> None:
    (tmp_path / "report.json").write_text(
        '{"format": "resfit-report", "input": {"name": "a\\udcff \\ud83e\\udd84"}}'
    )
    name = text_at(read_report(tmp_path), "input", "name")
    assert name == "a? \N{UNICORN FACE}"


def test_depth_is_that_of_objects_and_lists() -> None:
    check_depth({"a": [{"b": 1}]}, 3)
    with pytest.raises(ValueError, match="too deeply"):
        check_depth({"a": [{"b": 1}]}, 2)
    check_depth("text", 0)


def test_a_mesh_that_a_report_names_must_be_a_file_of_a_usual_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hashed: list[Path] = []

    def hash_of(path: Path) -> str:
        hashed.append(path)
        return "0" * 64

    monkeypatch.setattr("resfit.viewer.model.documents.sha256_of_file", hash_of)
    (tmp_path / "empty.stl").touch()
    os.mkfifo(tmp_path / "pipe.stl")
    with (tmp_path / "huge.stl").open("wb") as stream:
        stream.truncate(3 << 30)
    (tmp_path / "good.stl").write_text("solid")
    names = [
        "/dev/zero",
        "/proc/kcore",
        "/proc/self/mem",
        "empty.stl",
        "pipe.stl",
        "huge.stl",
        "a\0b",
        "x" * 5000,
        ".",
    ]
    for name in (*names, "good.stl"):
        assert hashed == []
        report = {"format": "resfit-report", "input": {"name": name, "sha256": "0" * 64}}
        (tmp_path / "report.json").write_text(json.dumps(report))
        if name != "good.stl":
            assert reported_mesh(tmp_path / "assembly.json") is None, name
    assert reported_mesh(tmp_path / "assembly.json") == tmp_path / "good.stl"


@pytest.mark.parametrize(
    "changes",
    [
        {"seed": "a\nb; touch x"}, {"seed": 1.5}, {"seed": True}, {"name": "a\nb.stl"}, {"name": "a\u202eb.stl"},
        {"optimizer": "x\ncurl"}, {"adam": "x\ncurl"}, {"max_primitives": "9\n"}, {"rounds": 2.5}, {"snap": "yes"},
        {"objective": "a b"}, {"objective": ["x"]}, {"per_part": []}, {"preset": ["fast"]}, {"preset": "x\ny"},
    ],
)  # fmt: skip
def test_a_command_is_one_line_of_options_of_their_types(changes: dict[str, Any]) -> None:
    report: dict[str, Any] = {"input": {"name": "a.stl"}, "options": {"preset": "fast"}, "seed": 3}
    assert fit_command(report) == "resfit fit a.stl --preset fast --seed 3"
    for key, value in changes.items():
        place = {"seed": report, "name": report["input"]}.get(key, report["options"])
        place[key] = value
    assert fit_command(report) == ""


def test_what_stands_behind_a_command_is_plain() -> None:
    options = {"preset": "fast", "adam": {"axis": "; curl x | sh"}, "probes": False}
    command = fit_command({"input": {"name": "-rf.stl"}, "options": options})
    assert command == "resfit fit ./-rf.stl --preset fast  # and in Python: adam=..., probes=False"


def test_pictures_that_are_none(tmp_path: Path) -> None:
    from PIL import Image

    path = tmp_path / "preview.png"
    Image.new("RGB", (96, 36), "#778899").save(path)
    good = path.read_bytes()
    assert (thumbnail(path) or b"").startswith(b"RIFF")
    flipped = bytearray(good)
    flipped[60] ^= 1
    for content in (b"", b"hello", good[:60], bytes(flipped), good[:16] + b"\0\0\xea\x60" * 2 + good[24:]):
        path.write_bytes(content)
        assert thumbnail(path) is None
    assert thumbnail(tmp_path / "nowhere.png") is None


def test_one_damaged_fit_is_left_out_of_a_gallery(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, text in (("good", desk_lamp().to_json()), ("bad", b"{")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "assembly.json").write_bytes(text)
        (tmp_path / name / "viewer.html").touch()
        (tmp_path / name / "report.json").write_text('{"format": "resfit-report"}')
    assert main(["gallery", str(tmp_path / "good"), str(tmp_path / "bad"), "-o", str(tmp_path / "out")]) == 0
    assert [path.name for path in (tmp_path / "out" / "fits").iterdir()] == ["good"]
    assert f"left out: {tmp_path / 'bad' / 'assembly.json'}" in capsys.readouterr().err


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".ply", ".stl", ".html"])
def test_an_empty_assembly_is_not_exported(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Assembly().save(tmp_path / "assembly.json")
    assert main(["export", str(tmp_path / "assembly.json"), str(tmp_path / f"out{suffix}")]) == 2
    assert capsys.readouterr().err.endswith("has no parts: there is nothing to export.\n")
    assert [path.name for path in tmp_path.iterdir()] == ["assembly.json"]
