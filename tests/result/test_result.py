"""What `resfit.fit` returns, and the folder that it writes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import resfit
from resfit.api import start_rows
from resfit.assembly.colors import palette_color
from resfit.assembly.history import History
from resfit.assembly.transform import Transform
from resfit.errors import AssemblyError, InputError
from resfit.fitter.config import preset_config
from resfit.fitter.outcome import Status
from resfit.kernels.rows import BLEND, ROW, SHAPES, TRANSLATION
from resfit.result.fit_result import FitResult
from resfit.result.folder import OURS, check_folder, holds_fit
from resfit.result.measure import part_gains

WRITTEN = sorted(OURS)


@pytest.fixture(scope="module")
def mesh() -> trimesh.Trimesh:
    """Two boxes with a gap between them, 32 long, far from the origin."""
    left, right = trimesh.creation.box((10.0, 8.0, 4.0)), trimesh.creation.box((20.0, 4.0, 4.0))
    right.apply_translation((17.0, 0.0, 0.0))
    both = trimesh.util.concatenate([left, right])
    both.apply_translation((500.0, -200.0, 50.0))
    return both


@pytest.fixture(scope="module")
def result(mesh: trimesh.Trimesh) -> FitResult:
    return resfit.fit(mesh, preset="fast", device="cpu")


def test_gains_are_what_each_part_adds(result: FitResult) -> None:
    config = preset_config("fast", device="cpu")
    rows, families = np.repeat(result.assembly.rows(), 2, axis=0), ["superfrustum"] * 4
    rows[1::2, SHAPES : SHAPES + 3] *= 0.7
    rows[:, BLEND] = 0.03
    whole, gains = part_gains(rows, families, result.target, config)
    for index, gain in enumerate(gains):
        rest = part_gains(np.delete(rows, index, axis=0), families[1:], result.target, config)[0]
        assert gain == whole.objective - rest.objective
    alone, gains = part_gains(rows[:1], families[:1], result.target, config)
    assert gains == (alone.objective,)


def test_two_boxes_are_found(result: FitResult) -> None:
    assert [part.name for part in result.assembly.primitives] == ["part_00", "part_01"]
    assert [part.color for part in result.assembly.primitives] == [palette_color(0), palette_color(1)]
    assert result.metrics["iou"] > 0.97
    assert not result.status.stopped_early and not result.placeholder
    assert result.input.closed and result.input.name == "mesh" and result.input.faces == 24


def test_assembly_is_in_the_frame_of_the_mesh(result: FitResult) -> None:
    distance = result.assembly.sdf([[500.0, -200.0, 50.0], [520.0, -200.0, 50.0], [500.0, -150.0, 50.0]])
    assert distance[0] < -1.5 and distance[1] < -1.5
    assert distance[2] == pytest.approx(46.0, abs=1.0)


def test_page_shows_the_input_where_it_lies(result: FitResult, mesh: trimesh.Trimesh, tmp_path: Path) -> None:
    result.write_page(tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text()
    data = json.loads(text.partition('id="data">')[2].partition("</script>")[0])
    transform = result.assembly.transform
    low, size = (np.array(data["mesh"][key]) for key in ("low", "size"))
    np.testing.assert_allclose(transform.to_mesh(np.array([low, low + size])), mesh.bounds, atol=1e-3)
    assert data["title"] == "mesh" and data["facts"][0].startswith(
        f"IoU {result.metrics['iou']:.3f} as fitted"
    )


def test_metrics_and_costs(result: FitResult) -> None:
    wanted = {"iou", "overlap", "unoverlap", "primitive_count", "floats", "filled_holes", "cpu_s", "wall_s"}
    wanted.add("peak_mb")
    assert set(result.metrics) == wanted
    assert result.metrics["primitive_count"] == 2
    assert result.metrics["wall_s"] > 0 and result.metrics["cpu_s"] > 0 and result.metrics["peak_mb"] > 50
    assert {"target", "propose", "refine", "metrics", "compile"} <= set(result.timings)
    assert result.deviation is not None and result.deviation.p95 < 0.5
    assert len(result.gains) == 2 and min(result.gains) > 0.1
    assert result.objective["objective"] > 0.9


def test_provenance_has_what_decides_the_result(result: FitResult) -> None:
    provenance = result.assembly.provenance
    assert provenance.seed == 0 and provenance.input_sha256 == result.input.sha256
    assert provenance.options["preset"] == "fast" and provenance.options["primitive"] == "superfrustum"
    assert not {"device", "timeout"} & set(provenance.options)


def test_folder(result: FitResult, mesh: trimesh.Trimesh, tmp_path: Path) -> None:
    folder = result.save(tmp_path / "deep" / "boxes.resfit")
    assert sorted(path.name for path in folder.iterdir()) == WRITTEN
    assert [path.name for path in folder.parent.iterdir()] == ["boxes.resfit"]
    assembly = resfit.Assembly.load(folder / "assembly.json")
    assert assembly.to_json() == result.assembly.to_json()
    scene = trimesh.load_scene(folder / "parts.glb")
    assert sorted(scene.geometry) == ["part_00", "part_01"]
    np.testing.assert_allclose(scene.bounds, mesh.bounds, atol=0.5)
    with Image.open(folder / "preview.png") as picture:
        assert picture.size == (960, 360)
        assert np.asarray(picture).std() > 10
    report = json.loads((folder / "report.json").read_text())
    assert report["format"] == "resfit-report"
    assert report["status"]["sentence"] == result.status.value
    assert report["input"]["sentence"] == result.input.sentence
    assert [part["gain"] > 0 for part in report["parts"]] == [True, True]
    assert report["metrics"]["iou"] == pytest.approx(result.metrics["iou"], abs=1e-6)
    assert {"parts", "preview"} <= set(report["timings"])
    assert str(tmp_path) not in (folder / "report.json").read_text()


def test_history_of_rounds(result: FitResult, tmp_path: Path) -> None:
    result.history.save(tmp_path / "history.npz")
    history = History.load(tmp_path / "history.npz")
    assert history.transform == result.assembly.transform and history.family == "superfrustum"
    assert len(history.rounds) == len(result.history.rounds) >= 1
    for loaded, saved in zip(history.rounds, result.history.rounds, strict=True):
        np.testing.assert_array_equal(loaded.kept, saved.kept)
        np.testing.assert_array_equal(loaded.candidates, saved.candidates)
        assert loaded.kept.shape[1] == ROW and loaded.score == saved.score
        assert loaded.regions == saved.regions and loaded.accepted == saved.accepted
    content = (tmp_path / "history.npz").read_bytes()
    history.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == content


@pytest.mark.parametrize("content", [b"", b"text", b"PK\x03\x04 no archive"])
def test_files_that_are_no_history(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "bad.npz").write_bytes(content)
    with pytest.raises(AssemblyError, match="is not a history"):
        History.load(tmp_path / "bad.npz")
    np.savez(tmp_path / "other.npz", header=np.frombuffer(b"{}", np.uint8))
    with pytest.raises(AssemblyError, match="is not a history"):
        History.load(tmp_path / "other.npz")
    with pytest.raises(AssemblyError, match="cannot read"):
        History.load(tmp_path / "missing.npz")


def test_earlier_fit_is_replaced_and_other_files_stay(result: FitResult, tmp_path: Path) -> None:
    folder = tmp_path / "fit"
    folder.mkdir()
    result.save(folder)
    (folder / "notes.txt").write_text("mine")
    (folder / "viewer.html").write_text("of the earlier fit")
    (folder / "assembly.json").write_text("old")
    result.save(folder)
    assert sorted(path.name for path in folder.iterdir()) == sorted([*WRITTEN, "notes.txt"])
    assert resfit.Assembly.load(folder / "assembly.json") == result.assembly
    assert "of the earlier fit" not in (folder / "viewer.html").read_text(encoding="utf-8")


def test_folders_of_others_are_left_alone(result: FitResult, tmp_path: Path) -> None:
    (tmp_path / "report.json").write_text('{"format": "of another program"}')
    with pytest.raises(InputError, match="is not empty and holds no earlier fit"):
        result.save(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["report.json"]
    with pytest.raises(InputError, match="is no folder"):
        result.save(tmp_path / "report.json")
    with pytest.raises(InputError, match="cannot write to"):
        result.save(tmp_path / "report.json" / "fit")


def test_inputs_are_not_overwritten(tmp_path: Path) -> None:
    folder = tmp_path / "fit"
    check_folder(folder, [folder / "chair.glb", tmp_path / "assembly.json"])
    with pytest.raises(InputError, match="would overwrite"):
        check_folder(folder, [folder / ".." / "fit" / "parts.glb"])


def test_failure_leaves_nothing_half_written(
    result: FitResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    result.save(tmp_path / "old")
    before = {path.name: path.read_bytes() for path in (tmp_path / "old").iterdir()}
    monkeypatch.setattr("resfit.result.fit_result.export_assembly", full)
    for name in ("old", "new"):
        with pytest.raises(InputError, match="No space left"):
            result.save(tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == ["old"]
    assert {path.name: path.read_bytes() for path in (tmp_path / "old").iterdir()} == before


def test_what_a_killed_run_left_is_no_obstacle(result: FitResult, tmp_path: Path) -> None:
    (tmp_path / ".fit.resfit-1.tmp").mkdir()
    result.save(tmp_path)
    assert holds_fit(tmp_path)


def test_stopped_before_it_began(mesh: trimesh.Trimesh) -> None:
    stopped = resfit.fit(mesh, preset="fast", device="cpu", should_stop=lambda: True)
    assert stopped.status is Status.INTERRUPTED and stopped.placeholder
    assert len(stopped.assembly.primitives) == 1
    np.testing.assert_allclose(stopped.assembly.to_mesh(32).bounds, mesh.bounds, atol=1.5)
    late = resfit.fit(mesh, preset="fast", device="cpu", timeout=1e-3)
    assert late.status is Status.TIMEOUT and late.placeholder


def test_going_on_from_an_assembly(result: FitResult, mesh: trimesh.Trimesh, tmp_path: Path) -> None:
    again = resfit.fit(mesh, preset="fast", device="cpu", rounds=1, init=result.save(tmp_path / "fit"))
    assert again.metrics["iou"] >= result.metrics["iou"] - 1e-3
    assert again.assembly.provenance.options["init_sha256"]
    with pytest.raises(InputError, match="is a superfrustum, but cuboid is fitted"):
        resfit.fit(mesh, preset="fast", device="cpu", primitive="cuboid", init=result.assembly)


def test_start_rows_move_to_another_frame(result: FitResult) -> None:
    old, there = result.assembly.transform, result.assembly.primitives[0].pose.translation
    new = Transform(2.0 * old.scale, (old.translation[0] + old.scale, *old.translation[1:]))
    same, rows = result.assembly.rows(), start_rows(result.assembly, "superfrustum", new)
    expected = new.to_normalised(old.to_mesh([there]))[0]
    np.testing.assert_allclose(rows[0, TRANSLATION : TRANSLATION + 3], expected, atol=1e-6)
    np.testing.assert_allclose(rows[:, SHAPES : SHAPES + 3], 0.5 * same[:, SHAPES : SHAPES + 3], rtol=1e-6)
    np.testing.assert_allclose(rows[:, BLEND], 0.5 * same[:, BLEND], rtol=1e-6)
    moved = replace(result.assembly, transform=old)
    np.testing.assert_array_equal(start_rows(moved, "superfrustum", old), same)


def test_options_that_make_no_sense(mesh: trimesh.Trimesh) -> None:
    with pytest.raises(InputError, match="there is no option speed"):
        resfit.fit(mesh, speed=3)  # type: ignore[call-arg]
    with pytest.raises(InputError, match="not both"):
        resfit.fit(mesh, resfit.FitConfig(), preset="fast")
    with pytest.raises(InputError, match="preset"):
        resfit.fit(mesh, preset="slow")


def test_progress_goes_from_nothing_to_all(mesh: trimesh.Trimesh) -> None:
    seen: list = []
    resfit.fit(mesh, None, seen.append, preset="fast", device="cpu", rounds=1)
    assert [entry.stage for entry in seen[:4]] == ["load", "solid", "grid", "samples"]
    fractions = [entry.fraction for entry in seen]
    assert fractions == sorted(fractions) and fractions[0] == 0.0 and fractions[-1] <= 1.0


def test_a_wreck_is_no_result(tmp_path: Path) -> None:
    cubes = [trimesh.creation.box((0.01, 0.01, 0.01)) for _ in range(30)]
    for number, cube in enumerate(cubes):
        cube.apply_translation([150.0 * number, 90.0 * (number % 7), 70.0 * (number % 5)])
    found = resfit.fit(trimesh.util.concatenate(cubes), preset="fast", max_primitives=4)
    with pytest.raises(InputError, match="nothing was written"):
        found.save(tmp_path / "wreck")
    assert not (tmp_path / "wreck").exists()
