"""The objective chamfer: the derivative, what it moves, and how it is asked for."""

from __future__ import annotations

import json
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
import pytest
import trimesh

from resfit.api import fit
from resfit.assembly.assembly import Assembly
from resfit.cli import main
from resfit.errors import InputError
from resfit.eval.methods.primitive_anything import DEFAULTS, read_primitives
from resfit.fitter.refine.chamfer import ChamferConfig, lessen_chamfer, measure_chamfer
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.primitives import family
from resfit.kernels.rows import BLEND, GATE, SHAPE, SHAPES, empty_rows
from resfit.shape.target import make_target

QUICK = ChamferConfig(steps=60, points=2048, redraw=20, resolution=48)


def box_row(size: tuple[float, float, float], place: tuple[float, float, float]) -> np.ndarray:
    """One cuboid (1, ROW)."""
    row = empty_rows(1)
    row[0, :3] = place
    row[0, SHAPES : SHAPES + SHAPE] = family("cuboid").shape_row(size=size)
    return row


def test_a_box_finds_its_place_and_size(device):
    target = make_target(trimesh.creation.box((1.8, 1.0, 0.6)), device, 32, 4000)
    start = box_row((1.6, 1.1, 0.7), (0.08, -0.05, 0.04))
    moved = lessen_chamfer(
        target, start, ["cuboid"], device, ChamferConfig(steps=150, points=2048, resolution=48)
    )
    assert moved.after < 0.02 * moved.before and moved.steps == 150
    np.testing.assert_allclose(moved.rows[0, :3], 0.0, atol=0.01)
    np.testing.assert_allclose(moved.rows[0, SHAPES : SHAPES + 3], (1.8, 1.0, 0.6), atol=0.05)
    assert moved.rows[0, GATE] == 1.0 and moved.rows[0, BLEND] == 0.0


def test_what_is_right_already_comes_back_no_worse(device):
    target = make_target(trimesh.creation.box((1.8, 1.0, 0.6)), device, 32, 4000)
    start = box_row((1.8, 1.0, 0.6), (0.0, 0.0, 0.0))
    moved = lessen_chamfer(target, start, ["cuboid"], device, QUICK)
    assert moved.after <= moved.before < 1e-5
    stopped = lessen_chamfer(target, start, ["cuboid"], device, QUICK, should_stop=lambda: True)
    assert stopped.steps == 0 and stopped.rows is start
    assert lessen_chamfer(target, start[:0], [], device, QUICK).steps == 0


@pytest.mark.parametrize("name", ["potted_cactus.glb", "desk_lamp.json"])
def test_it_falls_on_bundled_shapes(name, device, tmp_path):
    """From the parts of a short fit, or of a hand-written assembly, shaken."""
    with as_file(files("resfit.data") / name) as path:
        if path.suffix == ".json":
            lamp = Assembly.load(path)
            mesh, start = lamp.to_mesh(resolution=96), lamp
        else:
            mesh = path
            start = fit(path, preset="fast", rounds=1, max_primitives=6).assembly
    target = make_target(mesh, device, 64, 4000)
    from resfit.assembly.change_of_frame import rows_in_frame

    rows = rows_in_frame(start, target.transform)
    rng = np.random.default_rng(3)
    rows[:, :3] += rng.normal(size=(len(rows), 3)) * 0.02
    families = [part.family for part in start.primitives]
    moved = lessen_chamfer(target, rows, families, device, QUICK)
    assert moved.after < 0.7 * moved.before
    again, _ = measure_chamfer(target, PrimitiveSet(moved.rows, families, device), QUICK.resolution)
    assert again == pytest.approx(moved.after, rel=1e-3)


@pytest.mark.slow
def test_mixed_families_of_another_tool(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """What the reader of PrimitiveAnything's files gives can be moved, and keeps its parts' names."""
    mesh = trimesh.util.concatenate(
        [
            trimesh.creation.box((2.0, 1.0, 1.0)),
            trimesh.creation.icosphere(3, 0.6).apply_translation((1.6, 0.0, 0.0)),
        ]
    )
    mesh.export(tmp_path / "both.ply")
    entries = [
        {
            "type_name": "CubeBevel",
            "location": [0.05, 0.05, 0.0],
            "rotation": [0, 0, 0],
            "scale": [0.9, 0.6, 0.5],
        },
        {
            "type_name": "SphereSharp",
            "location": [1.55, -0.1, 0.0],
            "rotation": [0, 0, 0],
            "scale": [0.7, 0.5, 0.6],
        },
    ]
    options = DEFAULTS | {"align": "none"}
    read_primitives(entries, tmp_path / "both.ply", options).save(tmp_path / "theirs.json")
    out = tmp_path / "out"
    arguments = ["fit", str(tmp_path / "both.ply"), "--init", str(tmp_path / "theirs.json"), "-o", str(out)]
    assert main([*arguments, "--objective", "chamfer", "--progress", "none"]) == 0
    assert "chamfer" in capsys.readouterr().out
    report = json.loads((out / "report.json").read_text())
    assert report["objective"]["chamfer"] < 0.5 * report["objective"]["chamfer_before"]
    found = Assembly.load(out / "assembly.json")
    assert [part.family for part in found.primitives] == ["cuboid", "superquadric"]
    assert [part.name for part in found.primitives] == ["part_00", "part_01"]
    assert found.provenance.options["objective"] == "chamfer"


def test_bad_usage():
    box = trimesh.creation.box((1, 1, 1))
    with pytest.raises(InputError, match="--init"):
        fit(box, objective="chamfer")
    lamp = Assembly.load(str(files("resfit.data") / "desk_lamp.json"))
    with pytest.raises(InputError, match="--snap"):
        fit(box, objective="chamfer", init=lamp, snap=True)
    with pytest.raises(InputError, match="only moves parts; --union and --whole need a fit without it"):
        fit(box, objective="chamfer", init=lamp, union="hard", per_part="off")
    with pytest.raises(InputError, match="no such objective"):
        fit(box, objective="beauty")  # type: ignore[arg-type]
