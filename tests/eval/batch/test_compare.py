"""`resfit compare` with stand-ins for the methods: processes, rows, tables, plots, pictures."""

from __future__ import annotations

import json
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import trimesh

from resfit.assembly.assembly import Assembly
from resfit.assembly.primitive import Pose, Primitive
from resfit.assembly.transform import Transform
from resfit.cli import main
from resfit.errors import InputError
from resfit.eval import methods
from resfit.eval.batch import compare
from resfit.eval.batch.child import run_measured
from resfit.eval.batch.compare import check_methods, find_output, read_rows
from resfit.eval.report.plot import front, make_marks, pareto_svg
from resfit.eval.report.tables import latex, markdown, shared, tables_of

STAND_IN = """
import shutil, sys, time
method, mesh, out = sys.argv[1:]
with open(out + "/../../calls.txt", "a") as calls:
    calls.write(method + "\\n")
if method == "copy":
    shutil.copy(mesh, out + "/parts.stl")
elif method == "assembly":
    shutil.copy(mesh.rsplit("/", 1)[0] + "/assembly.json", out)
    print(out + "/assembly.json")
elif method == "fails":
    sys.exit("resfit: this is too hard.")
elif method == "slow":
    time.sleep(60)
"""


class Described:
    DESCRIPTION = "a stand-in"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A box, a smaller one, and an assembly that is the first; methods that do next to nothing."""
    script = tmp_path / "stand_in.py"
    script.write_text(STAND_IN)
    names = ("copy", "assembly", "fails", "slow", "silent")
    monkeypatch.setattr(methods, "METHODS", dict.fromkeys(names, Described), raising=False)
    monkeypatch.setattr(compare, "WARM", "")
    monkeypatch.setattr(
        compare.Comparison,
        "command",
        lambda self, method, mesh, out: [sys.executable, str(script), method, str(mesh), str(out)],
    )
    (tmp_path / "meshes").mkdir()
    for name, size in (("box", (18.0, 9.0, 9.0)), ("cube", (9.0, 9.0, 9.0))):
        trimesh.creation.box(size).export(tmp_path / "meshes" / f"{name}.stl")
    part = Primitive("cuboid", "a", Pose(), {"size": (1.8, 0.9, 0.9)})
    Assembly((part,), Transform(10.0)).save(tmp_path / "meshes" / "assembly.json")
    return tmp_path


def run(folder: Path, *arguments: str) -> int:
    return main(["compare", *arguments, "-o", str(folder / "out"), "--no-emd"])


def calls(folder: Path) -> list[str]:
    return (folder / "out" / "calls.txt").read_text().split()


def test_rows_tables_and_pictures(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(folder, str(folder / "meshes"), "--methods", "copy,assembly") == 0
    shown = capsys.readouterr()
    assert "Mean over the 2 closed meshes" in shown.out and "4/4 cube, assembly" in shown.err
    rows = [json.loads(line) for line in (folder / "out" / "rows.jsonl").read_text().splitlines()]
    assert [(row["mesh"], row["method"]) for row in rows] == [
        ("box", "copy"), ("box", "assembly"), ("cube", "copy"), ("cube", "assembly"),
    ]  # fmt: skip
    # The box sticks out of the cube by half its length, but IoU is counted in [-1, 1] only.
    assert [round(row["iou"], 2) for row in rows] == [1.0, 1.0, 1.0, 0.91]
    assert rows[3]["surface_max"] == pytest.approx(0.9, abs=0.01) and "reaches beyond" in rows[3]["notes"][0]
    for row in rows:
        assert row["status"] == "ok" and row["exit_code"] == 0 and row["target_kind"] == "closed"
        assert row["wall_s"] > 0.0 and row["cpu_s"] > 0.0 and 1.0 < row["peak_mb"] < 200.0
        assert (
            row["prediction"] in ("copy/box/parts.stl", "copy/cube/parts.stl") or row["method"] == "assembly"
        )
    assert "| copy | **100.00** |" in (folder / "out" / "tables.md").read_text()
    assert r"\cellcolor{goldcell}100.00" in (folder / "out" / "tables.tex").read_text()
    ElementTree.parse(folder / "out" / "pareto.svg")
    from PIL import Image

    with Image.open(folder / "out" / "sheet.png") as sheet:
        assert sheet.width > 3 * 240 and sheet.height > 2 * 200
        assert len(sheet.convert("RGB").getcolors(1 << 20) or []) > 50


def test_finished_rows_are_not_computed_again(folder: Path) -> None:
    mesh = str(folder / "meshes" / "box.stl")
    assert run(folder, mesh, "--methods", "copy") == 0
    assert run(folder, mesh, "--methods", "copy,assembly") == 0
    assert calls(folder) == ["copy", "assembly"]
    # Other features: the fits that are there are scored again.
    code = "import sys, numpy; numpy.save(sys.argv[2], numpy.load(sys.argv[1]))"
    command = f'{sys.executable} -c "{code}" {{points}} {{out}}'
    assert run(folder, mesh, "--methods", "copy", "--features", command) == 0
    assert calls(folder) == ["copy", "assembly"]
    row = json.loads((folder / "out" / "rows.jsonl").read_text().splitlines()[-1])
    assert row["intra_prim"] > 0.0 and row["cpu_s"] > 0.0
    assert run(folder, mesh, "--methods", "copy", "--fresh") == 0
    assert calls(folder) == ["copy", "assembly", "copy"]
    assert len((folder / "out" / "rows.jsonl").read_text().splitlines()) == 1


def test_one_failure_does_not_stop_the_others(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "meshes" / "a_broken.glb").write_bytes(b"glTF nonsense")
    assert (
        run(folder, str(folder / "meshes"), str(folder / "none.obj"), "--methods", "fails,silent,copy") == 3
    )
    shown = capsys.readouterr().err
    assert "box, fails: this is too hard." in shown
    assert "box, silent: it wrote neither an assembly.json nor a mesh" in shown
    assert "10 of 12 fits failed" in shown and "there is no file" in shown
    report = (folder / "out" / "tables.md").read_text()
    assert "## Not finished" in report and "- a_broken, copy:" in report
    assert "| copy | 100.00 |" in report or "| copy | **100.00** |" in report
    assert calls(folder).count("copy") == 2


def test_a_fit_that_takes_too_long_is_killed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mesh = str(folder / "meshes" / "box.stl")
    assert run(folder, mesh, "--methods", "slow", "--timeout", "0.5") == 3
    row = next(iter(read_rows(folder / "out" / "rows.jsonl").values()))
    assert row["status"] == "timeout" and row["error"] == "it took too long" and row["wall_s"] < 20.0
    assert run(folder, mesh, "--methods", "slow", "--timeout", "0.5") == 3
    assert calls(folder) == ["slow"]


def test_bad_usage(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "nothing").mkdir()
    assert run(folder, "--methods", "copy") == 2
    assert run(folder, str(folder / "nothing"), "--methods", "copy") == 2
    assert run(folder, str(folder / "meshes"), "--methods", "no-such") == 2
    assert run(folder, str(folder / "meshes"), "--methods", ",") == 2
    assert not (folder / "out").exists()
    (folder / "out").mkdir()
    (folder / "out" / "thesis.tex").write_text("precious")
    assert run(folder, str(folder / "meshes"), "--methods", "copy") == 2
    sentences = capsys.readouterr().err.splitlines()
    assert len(sentences) == 5 and all(line.startswith("resfit: ") for line in sentences)
    assert "no mesh" in sentences[0] and "known are" in sentences[2] and "not empty" in sentences[4]


def test_methods_are_listed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", "--methods", "help"]) == 0
    assert "a stand-in" in capsys.readouterr().out


def test_selection_takes_different_shapes(folder: Path) -> None:
    trimesh.creation.box((4.5, 4.5, 4.5)).export(folder / "meshes" / "small_cube.stl")
    assert run(folder, str(folder / "meshes"), "--methods", "copy", "--select", "2") == 0
    rows = read_rows(folder / "out" / "rows.jsonl").values()
    assert sorted({row["mesh"] for row in rows}) == ["box", "cube"]


def test_methods_are_taken_once_and_may_have_arguments() -> None:
    assert check_methods(["ours", " mps", "ours", ""], ["ours", "mps"]) == ("ours", "mps")
    assert check_methods(["file:parts"], ["file"]) == ("file:parts",)
    with pytest.raises(InputError):
        check_methods(["filed:parts"], ["file"])


def test_cost_of_a_child_is_its_own() -> None:
    code = (
        "import sys; b = bytearray(60_000_000); b[::4096] = b'x' * len(b[::4096]); sys.stderr.write('done')"
    )
    found = run_measured([sys.executable, "-c", f"{code}\nfor _ in range(2_000_000): pass"])
    assert found.exit_code == 0 and found.stderr == "done" and not found.timed_out
    assert 60.0 < found.peak_mb < 100.0 and 0.02 < found.cpu_s <= found.wall_s + 0.1
    crashed = run_measured([sys.executable, "-c", "import os; os.abort()"])
    assert crashed.exit_code == -6 and "SIGABRT" in crashed.complaint


def test_child_and_its_children_are_ended() -> None:
    code = "import subprocess, sys; subprocess.run([sys.executable, '-c', 'import time; time.sleep(60)'])"
    found = run_measured([sys.executable, "-c", code], timeout=0.5)
    assert found.timed_out and found.wall_s < 20.0


def test_result_is_where_the_method_says(tmp_path: Path) -> None:
    (tmp_path / "b.glb").write_text("")
    (tmp_path / "named.obj").write_text("")
    silent = run_measured([sys.executable, "-c", ""])
    says = run_measured([sys.executable, "-c", f"print('working'); print({str(tmp_path / 'named.obj')!r})"])
    assert find_output(tmp_path, silent) == tmp_path / "b.glb"
    assert find_output(tmp_path, says) == tmp_path / "named.obj"
    assert find_output(tmp_path / "nothing", silent) is None


def row(mesh: str, method: str, iou: float, parts: int, **more: object) -> dict:
    numbers = {"cd": 0.1, "cd_floor": 0.05, "overlap": 0.0, "floats": 16 * parts, "cpu_s": 2.0, "emd": None}
    state = {"status": "ok", "closed": True, "target_kind": "closed"}
    return {"mesh": mesh, "method": method, "iou": iou, "primitive_count": parts} | numbers | state | more


ROWS = [
    row("a", "ours", 0.9, 10),
    row("b", "ours", 0.7, 20),
    row("c", "ours", 0.2, 99),
    row("a", "mps", 0.8, 30),
    row("b", "mps", 0.8, 40),
    {"mesh": "c", "method": "mps", "status": "failed", "error": "it crashed"},
    row("o", "ours", 0.5, 3, closed=False, surface_mean=0.01),
]


def test_statistics_are_over_what_all_finished() -> None:
    assert {entry["mesh"] for entry in shared([entry for entry in ROWS if entry.get("closed")])} == {"a", "b"}
    mean, median, worst = (dict(table.lines) for table in tables_of(ROWS)[:3])
    assert mean["ours"][0] == pytest.approx(80.0) and mean["mps"][0] == pytest.approx(80.0)
    assert median["mps"][0] == pytest.approx(80.0) and worst["ours"][0] == pytest.approx(70.0)
    assert worst["mps"][2] == 40.0
    table = tables_of(ROWS)[0]
    # Nobody measured EMD: no column of dashes. Equal numbers are equally good.
    assert [column.heading for column in table.columns] == ["IoU", "CD", "#Prims", "Overlap"]
    assert (table.rank(0, 0), table.rank(1, 0), table.rank(0, 2), table.rank(1, 2)) == (0, 0, 0, 1)
    assert table.floor == pytest.approx(0.05)


def test_report_says_what_each_table_is_of() -> None:
    text = markdown(ROWS)
    assert "## Mean over the 2 closed meshes that every method finished\n" in text
    assert "## Mean over the closed meshes that each method finished\n" in text
    assert "## Mean over 1 open mesh\n" in text and "- c, mps: it crashed" in text
    assert r"\#Prims" in latex(ROWS) and latex(ROWS).count(r"\begin{table}") == len(tables_of(ROWS))


def test_front_of_the_plot() -> None:
    marks = make_marks([*ROWS[:2], *ROWS[3:5], row("a", "best", 0.95, 12), row("b", "best", 0.95, 12)],
                       ["ours", "mps", "best"], "primitive_count")  # fmt: skip
    assert [mark.method for mark in front(marks)] == ["best"]
    assert marks[0].x == 15.0 and marks[0].y == pytest.approx(0.2) and marks[0].x_range == (12.5, 17.5)
    drawn = pareto_svg(ROWS)
    assert drawn == pareto_svg(ROWS)
    texts = {element.text for element in ElementTree.fromstring(drawn).iter() if element.tag.endswith("text")}
    assert {"ours", "mps", "1 - IoU", "primitives", "CPU seconds"} <= texts
    assert "no closed shape" in pareto_svg(ROWS[-1:])
