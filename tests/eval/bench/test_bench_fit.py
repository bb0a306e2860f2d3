"""Whole fits by stage, how they grow, and the published workload, on the smallest of cases."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh
import warp as wp

from resfit.cli import main
from resfit.errors import InputError
from resfit.eval.bench import growth, workload
from resfit.eval.bench.fit import markdown_page
from resfit.eval.bench.fit_kernels import measure_shares, shares_table
from resfit.eval.bench.fit_runs import FitRow, begins, stage_seconds
from resfit.eval.bench.growth import FEW, apart_parts, chart, exponent, growth_tables, read_sizes, wavy_torus
from resfit.eval.bench.scaling import measure_peak, measure_scaling, scaling_table

LOG = """{"event": "start", "elapsed_s": 0.0, "mesh": "a.stl"}
{"event": "progress", "elapsed_s": 1.0, "stage": "load"}
{"event": "progress", "elapsed_s": 1.25, "stage": "solid"}
{"event": "progress", "elapsed_s": 1.5, "stage": "grid"}
resfit: compiling kernels for this machine (first run only, then cached)...
{"event": "progress", "elapsed_s": 2.0, "stage": "samples"}
{"event": "progress", "elapsed_s": 2.75, "stage": "decompose"}
{"event": "progress", "elapsed_s": 3.5, "stage": "decompose"}
{"event": "writing", "elapsed_s": 5.0}
{"event": "done", "elapsed_s": 6.0}
"""

TIMINGS = {"start": 1.0, "target": 1.5, "decompose": 2.0, "novel": 0.25, "parts": 0.25, "preview": 0.5}


def test_stages_add_up_to_the_wall_time() -> None:
    stages = stage_seconds(TIMINGS | {"compile": 0.75}, begins(LOG), 7.0)
    assert stages == {
        "start": 1.0,
        "load": 0.25,
        "solid": 0.25,
        "grid": 0.5,
        "samples": 0.5,
        "prepare": 0.25,
        "decompose": 2.0,
        "export": 0.25,
        "preview": 0.5,
        "write": 0.25,
        "exit": 1.0,
        "other": 0.0,
        "novel": 0.25,
    }
    assert sum(stages.values()) == 7.0


def test_the_command_fits_and_writes_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("resfit.eval.batch.compare.WARM", "")
    trimesh.creation.box((18.0, 9.0, 9.0)).export(tmp_path / "box.stl")
    page, meshes = tmp_path / "page.md", [str(tmp_path / name) for name in ("box.stl", "gone.stl")]
    command = ["bench", "fit", *meshes, "--preset", "fast", "--repeats", "1", "--device", "cpu"]
    assert main([*command, "--markdown", str(page), "--json"]) == 3, "one mesh is not there"
    shown = capsys.readouterr()
    document = json.loads(shown.out)
    box, gone = document["rows"]
    assert (box["status"], box["faces"], box["primitives"], box["runs"]) == ("ok", 12, 1, 1)
    assert box["peak_mb"] > 50 and box["cpu_s"] > 0
    assert sum(box["stages"].values()) == pytest.approx(box["wall_s"], abs=1e-2)
    assert {"start", "load", "solid", "grid", "samples", "propose", "metrics", "write"} <= set(box["stages"])
    assert "gone.stl" in gone["status"] and "1 of 2 fits failed" in shown.err
    text = page.read_text()
    assert (
        "| box | 12 | 1 |" in text and "| propose |" in text and not (tmp_path / "page_growth.svg").exists()
    )


def test_the_command_refuses_what_it_cannot_use(tmp_path: Path) -> None:
    for arguments in (
        ["--repeats", "0"],
        ["--markdown", str(tmp_path / "none" / "a.md")],
        ["--grow", "--sizes", "x=1"],
    ):
        assert main(["bench", "fit", *arguments]) == 2


def test_sizes_are_read() -> None:
    assert read_sizes("") == FEW
    assert read_sizes("faces=1k,300,1M grid") == {"faces": (1024, 300, 1024**2), "grid": FEW["grid"]}
    for wrong in ("mood=1", "faces=many", "faces=0", "grid=64,"):
        with pytest.raises(InputError):
            read_sizes(wrong)


def test_meshes_are_closed_and_as_large_as_asked() -> None:
    assert len(wavy_torus(1024).faces) == 1024 and wavy_torus(1024).is_watertight
    parts = apart_parts(5)
    assert parts.body_count == 5 and parts.is_watertight
    boxes = [part.bounds for part in parts.split()]
    assert all(
        (np.maximum(a[0], b[0]) > np.minimum(a[1], b[1])).any()
        for index, a in enumerate(boxes)
        for b in boxes[:index]
    )


def test_growth_is_measured_tabled_and_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def stand_in(path: Path, options: dict, repeats: int, timeout: float | None) -> FitRow:
        asked.append(options)
        size = int(path.stem.split("_")[1])
        assert len(trimesh.load_mesh(path).faces) > 50
        stages = {"start": 1.0, "grid": 1e-6 * size**3, "write": 0.0}
        if size == 16:
            return FitRow(path.stem, "it took too long")
        return FitRow(path.stem, "ok", 1, 9, 2, 0.9, sum(stages.values()), 1.0, 99.0, 0.0, stages)

    monkeypatch.setattr(growth, "measure_fit", stand_in)
    seen: list[FitRow] = []
    grown = growth.measure_growth(
        {"grid": (128, 64, 16), "primitives": (8,), "soup": (60,)}, {"preset": "fast"}, 1, None, seen.append
    )
    assert [row.name for row in seen] == ["grid 16", "grid 64", "grid 128", "primitives 8", "soup 60"]
    assert asked[1] == {"preset": "fast", "per_part": "off", "resolution": 64}
    text = growth_tables(grown, "a.svg")
    assert "| grid | 0.262 | 2.097 | 3.00 |" in text and "Failed at 16: it took too long." in text
    assert "| load to samples | 0.262 | 2.097 | |" in text
    assert "| write | 0.000 | 0.000 |  |" in text and "![seconds by stage](a.svg)" in text
    drawn = ElementTree.fromstring(chart(grown))
    texts = [element.text for element in drawn.iter() if element.tag.endswith("text")]
    # A name once, whatever the number of panels; a stage that takes no time has no line.
    assert [texts.count(name) for name in ("start", "grid", "all", "write")] == [1, 1, 1, 0]
    assert {"64", "128", growth.LABELS["grid"], growth.LABELS["soup"]} <= set(texts)
    assert exponent([1, 10], [1.0, 100.0]) == pytest.approx(2.0)
    assert exponent([1], [1.0]) is None


def test_failures_stay_in_the_page() -> None:
    page = markdown_page([FitRow("a", "it took too long")], "fast", "a machine", 12.3)
    assert "| a | it took too long |" in page and "12.3 s more" in page


def test_the_published_workload_is_measured(device: wp.Device) -> None:
    rows = workload.measure_steps(device, counts=(2,), points=512)
    assert [(row.axes, row.order, row.step) for row in rows] == [
        (axes, order, step)
        for axes, order in ((3, "curve"), (1, "curve"), (1, "random"))
        for step in workload.STEPS
    ]
    assert all(row.ms > 0 and row.published_ms is None for row in rows)
    table = workload.workload_table(rows)
    assert (
        "at 512 points" in table
        and len(re.findall(r"^\| [31] \| 2 \| (?:curve|random) \|", table, re.M)) == 3
    )
    copies = workload.primitive_set(2, 3, device)
    assert len(copies) == 6 and len(workload.primitive_set(2, 1, device)) == 2


def test_kernels_of_a_fit_are_counted(device):
    """Launches, recorded ones too, are counted by kernel; shares add up to all."""
    rows = measure_shares(device, "fast")
    assert sum(row.share for row in rows) == pytest.approx(1.0)
    found = {row.kernel: row for row in rows}
    assert found["sum_normal_equations_kernel"].launches > 50
    assert all(row.share >= 0.01 for row in rows[:-1]) and rows[-1].kernel.endswith("others")
    assert "| sum_normal_equations_kernel |" in shares_table(rows)


def test_growth_of_the_union_and_the_peak(device):
    """Culling pays for many small primitives; the peak is above what the field comes to."""
    rows = measure_scaling(device, counts=(2, 64), sizes=(1000, 20_000))
    assert [(row.points, row.primitives) for row in rows] == [
        (1000, 2),
        (1000, 64),
        (20_000, 2),
        (20_000, 64),
    ]
    assert all(row.culled_one_core_ms > 0 for row in rows)
    peak = measure_peak(device, 3.0)
    assert 0.0 < peak.share < 1.5
    text = scaling_table(rows, peak)
    assert "| 20,000 culled |" in text and "K = 64" in text
