"""Making assemblies regular: what is symmetric, what snaps, what it may cost, and that it holds to the last bit."""

from __future__ import annotations

import json
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
import pytest
import trimesh
import warp as wp

import resfit
import resfit.cli
from resfit.fitter.config import FitConfig
from resfit.fitter.objective.cached import CachedObjective
from resfit.fitter.regularise.canonical import canonical_changes, is_box
from resfit.fitter.regularise.constraints import Constraints, Copied, symmetric_row
from resfit.fitter.regularise.relations import Relation, sum_up
from resfit.fitter.regularise.snap import snap
from resfit.fitter.regularise.symmetry import find_symmetries
from resfit.fitter.regularise.transaction import WHOLE_FALL, Claim, Transaction
from resfit.kernels.primitives import family
from resfit.kernels.rows import ROTATION, SHAPE, SHAPES, TRANSLATION, empty_rows
from resfit.shape.target import Target, make_target

LEGS = [(x, z) for x in (-0.7, 0.7) for z in (-0.4, 0.4)]
"""Where the legs of the table stand."""


def table() -> trimesh.Trimesh:
    """A top, 1.8 x 0.1 x 1.2, on four square legs."""
    top = trimesh.creation.box((1.8, 0.1, 1.2))
    top.apply_translation((0.0, 0.45, 0.0))
    legs = [trimesh.creation.box((0.12, 0.9, 0.12)) for _ in LEGS]
    for leg, (x, z) in zip(legs, LEGS, strict=True):
        leg.apply_translation((x, -0.05, z))
    return trimesh.util.concatenate([top, *legs])


def rough_table(rng: np.random.Generator) -> np.ndarray:
    """Its five boxes, each a little wrong in every number."""
    rows = empty_rows(5)
    sizes, places = [(1.8, 0.1, 1.2)], [(0.0, 0.45, 0.0)]
    for x, z in LEGS:
        sizes.append((0.12, 0.9, 0.12))
        places.append((x, -0.05, z))
    for row, size, place in zip(rows, sizes, places, strict=True):
        wrong = np.array(size) * (1.0 + rng.uniform(-0.01, 0.01, 3))
        row[SHAPES : SHAPES + SHAPE] = family("superfrustum").shape_row(
            size=wrong, roundness=0.02, dilation=0.001, taper=0.99, bulge=0.005, onion=-0.4
        )
        row[TRANSLATION : TRANSLATION + 3] = np.array(place) + rng.uniform(-0.002, 0.002, 3)
        turn = np.array([1.0, *rng.uniform(-0.004, 0.004, 3)])
        row[ROTATION : ROTATION + 4] = turn / np.linalg.norm(turn)
    return rows


@pytest.fixture(scope="module")
def target() -> Target:
    from resfit.kernels.runtime.launch import choose_device

    return make_target(table(), choose_device("cpu"), 64, 4000)


def names_of(target: Target) -> list[str]:
    return [found.name for found in find_symmetries(target)]


def test_symmetries_of_a_table(target: Target) -> None:
    found = names_of(target)
    assert found[:2] == ["symmetry about x", "symmetry about z"]
    assert "2-fold symmetry about y" in found and "symmetry about y" not in found


def test_symmetries_of_other_shapes(device: wp.Device) -> None:
    torus = names_of(make_target(trimesh.creation.torus(1.0, 0.3), device, 32, 2000))
    assert "12-fold symmetry about z" in torus and "symmetry about z" in torus
    wedge = trimesh.convex.convex_hull([[0, 0, 0], [3, 0, 0], [0, 1, 0], [0, 0, 1.7], [1, 1, 1]])
    assert names_of(make_target(wedge, device, 32, 2000)) == []


def test_a_table_becomes_regular(target: Target, device: wp.Device, rng: np.random.Generator) -> None:
    config, rough = FitConfig(preset="fast"), rough_table(rng)
    regular = snap(rough, target, config, device)
    rows, relations = regular.rows, regular.relations
    cached_objective = CachedObjective(target, config, device)
    assert cached_objective.objective(rows) >= cached_objective.objective(rough) - WHOLE_FALL
    assert len(rows) == 5
    for row in rows:
        assert is_box(row, "superfrustum")
        np.testing.assert_array_equal(row[ROTATION : ROTATION + 4], [1.0, 0.0, 0.0, 0.0])
    legs = rows[1:]
    np.testing.assert_array_equal(legs[:, SHAPES : SHAPES + 3], legs[[0] * 4, SHAPES : SHAPES + 3])
    np.testing.assert_array_equal(np.abs(legs[:, TRANSLATION]), np.abs(legs[[0] * 4, TRANSLATION]))
    np.testing.assert_array_equal(rows[0, [TRANSLATION, TRANSLATION + 2]], [0.0, 0.0])
    symmetries = [relation for relation in relations if relation.kind == "symmetry"]
    assert {relation.value["name"] for relation in symmetries} == {"symmetry about x", "symmetry about z"}
    assert all(relation.value["complete"] for relation in symmetries)
    np.testing.assert_array_equal(snap(rough, target, config, device).rows, rows)
    assert set(regular.origin) <= {0, 1, 2, 3, 4}


def test_a_missing_leg_grows(target: Target, device: wp.Device, rng: np.random.Generator) -> None:
    grown = snap(rough_table(rng)[:4], target, FitConfig(preset="fast"), device)
    rows = grown.rows
    assert len(rows) == 5 and len(grown.origin) == 5
    np.testing.assert_array_equal(rows[4, SHAPES : SHAPES + 3], rows[3, SHAPES : SHAPES + 3])
    nothing = snap(np.zeros((0, 17), np.float32), target, FitConfig(preset="fast"), device)
    assert len(nothing.rows) == 0 and nothing.relations == []


def test_what_costs_too_much_is_not_done(target: Target, device: wp.Device, rng: np.random.Generator) -> None:
    rows = rough_table(rng)
    transaction = Transaction(rows, CachedObjective(target, FitConfig(preset="fast"), device), Constraints())
    claim = Claim("size", (0, 1), "all", lambda rows: 0.0)

    def flatten(rows: np.ndarray) -> np.ndarray:
        rows[:, SHAPES + 1] = 0.05
        return rows

    def toggle(rows: np.ndarray) -> np.ndarray:
        rows[0, TRANSLATION] = -rows[0, TRANSLATION]
        return rows

    assert not transaction.attempt(flatten, claim) and not transaction.attempt(toggle, claim)
    assert transaction.claims == [] and transaction.rows is rows
    assert transaction.attempt(lambda rows: rows, claim) and len(transaction.relations()) == 1


def test_canonical_changes_are_small_and_end() -> None:
    row = empty_rows(1)[0]
    row[SHAPES : SHAPES + SHAPE] = family("superfrustum").shape_row(
        size=(0.4, 0.41, 0.8), roundness=0.95, dilation=0.01, taper=0.96, bulge=0.02, onion=-0.3
    )
    seen = []
    while changes := canonical_changes(row, "superfrustum"):
        row = changes[0].row
        seen.append(changes[0].rule.name)
    assert seen == ["onion", "bulge", "taper", "dilation", "roundness", "square"]
    assert row[SHAPES] == row[SHAPES + 1] and row[SHAPES + 2] == pytest.approx(0.82)
    far = family("superfrustum").shape_row(
        size=(0.4, 0.6, 0.8), roundness=0.5, taper=0.5, bulge=0.5, onion=0.5
    )
    row[SHAPES : SHAPES + SHAPE] = far
    assert canonical_changes(row, "superfrustum") == []
    row[SHAPES : SHAPES + SHAPE] = family("superquadric").shape_row(size=(0.4, 0.41, 0.8))
    assert [change.rule.name for change in canonical_changes(row, "superquadric")] == ["square"]


def test_ties_hold_and_do_not_creep(rng: np.random.Generator) -> None:
    mirror = np.diag([-1.0, 1.0, 1.0])
    rows = rough_table(rng)
    constraints = Constraints((Copied(1, 3, mirror, np.zeros(3)),), {0: ((mirror, np.zeros(3)),)})
    tied = constraints.complete(rows, ["superfrustum"] * 5)
    np.testing.assert_array_equal(constraints.complete(tied, ["superfrustum"] * 5), tied)
    assert tied[3, TRANSLATION] == -tied[1, TRANSLATION] and tied[0, TRANSLATION] == 0.0
    assert constraints.free(5) == [0, 1, 2, 4] and constraints.followers(1) == [1, 3]
    moved = symmetric_row(rows[0], "superfrustum", ((mirror, np.zeros(3)),))
    assert abs(float(moved[ROTATION + 2])) < 1e-6 and abs(float(moved[ROTATION + 3])) < 1e-6


def test_summary_of_relations() -> None:
    symmetry = {"name": "symmetry about x", "complete": True}
    relations = [Relation("axis", (0,), 1), Relation("axis", (1,), 1), Relation("size", (0, 1), 1.0)]
    assert sum_up([]) == ""
    assert sum_up(relations) == "3 relations: 2 axes, 1 size"
    assert sum_up([Relation("symmetry", (0, 1), symmetry)]) == "1 relation: symmetry about x"
    partial = Relation("symmetry", (0, 1), {**symmetry, "complete": False})
    assert sum_up([*relations[:1], partial]) == "2 relations: 1 axis, symmetry about x of 2 parts"


def test_snapped_fit_of_the_bundled_mesh(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with as_file(files("resfit.data") / "potted_cactus.glb") as mesh:
        options = ["--preset", "fast", "--device", "cpu", "--snap", "-o", str(tmp_path / "fit")]
        assert resfit.cli.main(["fit", str(mesh), *options]) == 0
    assert "  snapped  " in capsys.readouterr().out
    report = json.loads((tmp_path / "fit" / "report.json").read_text())
    assembly = resfit.Assembly.load(tmp_path / "fit" / "assembly.json")
    parts = {part.name: part for part in assembly.primitives}
    assert report["relations"] and report["options"]["snap"] is True
    for relation in report["relations"]:
        found = [parts[name] for name in relation["parts"]]
        value = relation["value"]
        if relation["kind"] == "centre":
            axis = "xyz".index(value["axis"])
            assert {np.float32(part.pose.translation[axis]) for part in found} == {np.float32(value["at"])}
        if relation["kind"] == "size" and isinstance(value, list):
            assert {tuple(np.float32(part.parameters["size"])) for part in found} == {
                tuple(np.float32(value))
            }
        for parameter in ("taper", "bulge", "onion", "roundness", "dilation"):
            if relation["kind"] == "canonical" and parameter in value:
                assert {part.parameters[parameter] for part in found} == {value[parameter]}
