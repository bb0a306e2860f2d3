"""The trade-off curve of a fit, its files, and assemblies cut to their most worthwhile parts."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import cast
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

import resfit
import resfit.cli
from resfit.assembly.assembly import Assembly
from resfit.assembly.primitive import Pose, Primitive
from resfit.assembly.worth import exclusive_volumes, part_worths
from resfit.errors import InputError
from resfit.fitter.objective.cached import CachedObjective
from resfit.fitter.objective.objective import ObjectiveSamples, Tally
from resfit.fitter.search.pareto import remove_down_to, rising
from resfit.result.fit_result import FitResult
from resfit.result.folder import PARETO
from resfit.result.pareto import Point


@pytest.fixture(scope="module")
def result() -> FitResult:
    """A fit of three boxes with its curve."""
    return resfit.fit(three_boxes(), preset="fast", device="cpu", pareto=True)


def three_boxes() -> trimesh.Trimesh:
    """Boxes of falling size in a row."""
    boxes = [trimesh.creation.box((size, size, size)) for size in (2.0, 1.5, 1.0)]
    for box, place in zip(boxes, (0.0, 2.5, 4.5), strict=True):
        box.apply_translation((place, 0.0, 0.0))
    return trimesh.util.concatenate(boxes)


def test_curve_rises_through_the_chosen_one(result: FitResult) -> None:
    curve = result.curve
    assert curve is not None
    counts = [point.count for point in curve.points]
    assert counts[:3] == [1, 2, 3]
    assert [len(assembly.primitives) for assembly in curve.assemblies] == counts
    check_that_it_rises(curve.points)
    (chosen,) = [index for index, point in enumerate(curve.points) if point.chosen]
    assert curve.assemblies[chosen].rows().tobytes() == result.assembly.rows().tobytes()
    assert curve.points[chosen].objective == pytest.approx(result.objective["objective"], abs=1e-5)
    assert curve.points[2].iou > 0.95 > curve.points[0].iou
    assert result.metrics["iou"] == pytest.approx(curve.points[chosen].iou, abs=1e-5)


def check_that_it_rises(points: Sequence[Point]) -> None:
    """More parts never match less."""
    for fewer, more in pairwise(points):
        assert fewer.count < more.count and fewer.iou <= more.iou and fewer.worth <= more.worth


def test_the_curve_does_not_change_the_fit(result: FitResult) -> None:
    plain = resfit.fit(three_boxes(), preset="fast", device="cpu")
    assert plain.assembly.to_json() == result.assembly.to_json()


@pytest.mark.parametrize(
    ("values", "kept"),
    [
        ((0.1, 0.5, 0.4, 0.6, 0.9), [1, 2, 4, 5]),
        ((0.1, 0.7, 0.4, 0.6, 0.5), [1, 3, 4]),
    ],
)
def test_what_falls_is_left_out(values: tuple[float, ...], kept: list[int]) -> None:
    """The chosen one, of four parts here, never is."""
    assert rising(list(enumerate(values, 1)), 4) == kept


@pytest.mark.slow
def test_a_limit_finds_what_the_curve_has() -> None:
    boxes = [trimesh.creation.box(size) for size in ((4, 2, 1), (1, 1, 3), (2, 1, 1), (1, 3, 1))]
    for number, box in enumerate(boxes):
        box.apply_translation((1.7 * number, 0.3 * number, 0.5 * number))
    mesh = trimesh.util.concatenate(boxes)
    curve = resfit.fit(mesh, preset="fast", device="cpu", pareto=True).curve
    assert curve is not None
    check_that_it_rises(curve.points)
    for most in (2, 4):
        few = resfit.fit(mesh, preset="fast", device="cpu", max_primitives=most)
        known = max(point.worth for point in curve.points if point.count <= most)
        assert few.objective["objective"] + few.options["parsimony"] * len(few.gains) <= known + 1e-6


def test_files_come_and_go(result: FitResult, tmp_path: Path) -> None:
    folder = result.save(tmp_path / "fit")
    assert {path.name for path in folder.iterdir()} >= {*PARETO, "pareto"}
    assert result.curve is not None
    saved = sorted((folder / "pareto").iterdir())
    assert [path.name for path in saved] == [
        f"assembly_{point.count:02d}.json" for point in result.curve.points
    ]
    assert Assembly.load(saved[0]).transform == result.assembly.transform
    rows = json.loads((folder / "pareto.json").read_text())
    with (folder / "pareto.csv").open() as stream:
        table = list(csv.DictReader(stream))
    assert [row["count"] for row in table] == [str(row["count"]) for row in rows]
    assert float(table[-1]["iou"]) == rows[-1]["iou"] and set(rows[0]) >= {
        "surface_p95",
        "floats",
        "objective",
    }
    assert ElementTree.parse(folder / "pareto.svg").getroot().tag.endswith("svg")
    # The fit that replaces it has no curve; what others put into the folder stays.
    (folder / "pareto" / "notes.txt").write_text("mine")
    plain = resfit.FitResult(**{**result.__dict__, "curve": None})
    plain.save(folder)
    assert not any((folder / name).exists() for name in PARETO)
    assert [path.name for path in (folder / "pareto").iterdir()] == ["notes.txt"]
    result.save(folder)
    (folder / "pareto" / "notes.txt").unlink()
    plain.save(folder)
    assert not (folder / "pareto").exists()


def crate(name: str, size: float, place: float) -> Primitive:
    return Primitive("cuboid", name, Pose((place, 0.0, 0.0)), {"size": (size, size, size)})


def test_worth_is_what_a_part_alone_holds() -> None:
    assembly = Assembly((crate("large", 0.8, -0.4), crate("hidden", 0.6, -0.4), crate("small", 0.4, 0.5)))
    large, hidden, small = exclusive_volumes(assembly, "cpu")
    assert large == pytest.approx(0.8**3 - 0.6**3, rel=0.1) and small == pytest.approx(0.4**3, rel=0.1)
    assert 0.0 < hidden < 1e-3
    assert [part.name for part in assembly.top(2, [large, hidden, small]).primitives] == ["large", "small"]
    assert exclusive_volumes(Assembly(), "cpu") == []
    assert assembly.top(9, [1.0, 2.0, 3.0]) == assembly


def test_export_of_the_most_worthwhile(result: FitResult, tmp_path: Path) -> None:
    folder = result.save(tmp_path / "fit")
    path, small = folder / "assembly.json", tmp_path / "small.glb"
    assert resfit.cli.main(["export", str(path), str(small), "--top", "1", "--device", "cpu"]) == 0
    best = result.assembly.primitives[int(np.argmax(result.gains))].name
    assert list(trimesh.load_scene(small).geometry) == [best]
    assert part_worths(result.assembly, path) == [round(gain, 6) for gain in result.gains]
    # Without the report beside it, and with one of other parts, volumes tell: the largest box again.
    (folder / "report.json").unlink()
    assert part_worths(result.assembly, path, "cpu") == exclusive_volumes(result.assembly, "cpu")
    assert int(np.argmax(part_worths(result.assembly, path, "cpu"))) == int(np.argmax(result.gains))
    assert resfit.cli.main(["export", str(path), str(small), "--top", "0"]) == InputError.exit_code


def test_progress_of_all_stages() -> None:
    boxes = [trimesh.creation.box((1.0, 1.0, 1.0)), trimesh.creation.box((0.5, 2.0, 0.5))]
    boxes[1].apply_translation((2.0, 0.0, 0.0))
    seen: list = []
    options = {"preset": "fast", "device": "cpu", "rounds": 1, "snap": True, "pareto": True, "per_part": "on"}
    result = resfit.fit(trimesh.util.concatenate(boxes), None, seen.append, **options)
    assert [entry.stage for entry in seen][-2:] == ["snap", "curve"] and "parts" in [
        entry.stage for entry in seen
    ]
    fractions = [entry.fraction for entry in seen]
    assert fractions == sorted(fractions) and fractions[-1] <= 1.0
    assert result.snapped and [part.name for part in result.assembly.primitives][:2] == ["body_01", "body_02"]


def test_the_least_missed_parts_go_first() -> None:
    """Of four spans of a line, the first holds the second, the third adds most, and the fourth is outside."""
    x = np.linspace(-1.0, 1.0, 400)
    points = np.stack([x, np.zeros(400), np.zeros(400)], axis=1).astype(np.float32)
    distance = (np.abs(x) - 0.8).astype(np.float32)
    samples = ObjectiveSamples(points, distance, np.ones(400, np.float32), 200)
    spans = np.array([(-0.8, -0.2), (-0.6, -0.4), (-0.2, 0.8), (0.8, 0.9)])
    values = np.maximum(spans[:, :1] - x, x - spans[:, 1:]).astype(np.float32)
    judge = cast(CachedObjective, SimpleNamespace(tally=Tally(samples), alpha=0.01))
    assert [remove_down_to(values, judge, count) for count in (4, 3, 2, 1, 0)] == [
        [0, 1, 2, 3],
        [0, 1, 2],
        [0, 2],
        [2],
        [],
    ]
