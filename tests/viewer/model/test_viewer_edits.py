"""The viewer's model: sliders, edits, undo. No window, no VTK."""

from __future__ import annotations

import sys
from dataclasses import replace
from subprocess import run

import numpy as np
import pytest
from viewer_scenes import chain, primitive

from resfit.assembly.assembly import Assembly
from resfit.assembly.primitive import Pose
from resfit.errors import AssemblyError, InputError
from resfit.kernels.primitives import FAMILIES
from resfit.kernels.rows import ROTATION, SHAPES, TRANSLATION
from resfit.viewer.model.edit_session import EditSession
from resfit.viewer.model.edit_state import PartRef
from resfit.viewer.model.parameters import part_sliders, with_value
from resfit.viewer.model.poses import placed, pose_matrix, to_angles, to_quaternion


def session() -> EditSession:
    return EditSession([chain()])


def first(edits: EditSession) -> PartRef:
    return edits.refs()[0]


@pytest.mark.parametrize("family", FAMILIES)
def test_sliders_are_those_of_the_family_s_table(family: str) -> None:
    part = primitive(family, "a", (0.0, 0.0, 0.0))
    sliders = part_sliders(part)
    shape = [slider for slider in sliders if slider.group == "Shape"]
    assert len(shape) == FAMILIES[family].parameter_count
    for entry in FAMILIES[family].parameters:
        mine = [slider for slider in shape if slider.id.partition(".")[0] == entry.name]
        assert len(mine) == entry.count
        assert all(
            (slider.unit, slider.range, slider.legal) == (entry.unit, entry.slider, entry.legal)
            for slider in mine
        )
    assert [slider.id for slider in sliders[-1:]] == ["blend"]
    assert [slider.id for slider in part_sliders(part, first=True)][-1] == "rotation.2"


@pytest.mark.parametrize("family", FAMILIES)
def test_every_slider_changes_its_number_and_the_field(family: str, rng: np.random.Generator) -> None:
    # Generic, so that no number is idle: a box that is not square, rounded, hollow and bent.
    part = primitive(family, "a", (0.0, 0.0, 0.0))
    generic = {"size.1": 0.35, "roundness": 0.4, "onion": 0.2, "bulge": 0.2, "taper": 0.8, "rotation.0": 20.0}
    for name, value in generic.items():
        if any(slider.id == name for slider in part_sliders(part)):
            part = with_value(part, name, value)
    other = primitive("cuboid", "b", (0.3, 0.0, 0.0))
    points = rng.uniform(-0.6, 0.6, (4000, 3))
    for slider in part_sliders(part):
        low, high = slider.range
        value = slider.value + 0.13 * (high - low) * (1.0 if slider.value < 0.7 * high else -1.0)
        edited = with_value(part, slider.id, value)
        moved = {found.id for found in part_sliders(edited) for old in part_sliders(part)
                 if found.id == old.id and abs(found.value - old.value) > 1e-4}  # fmt: skip
        assert moved == {slider.id}
        columns = np.flatnonzero(edited.row() != part.row())
        if slider.group == "Shape":
            assert len(columns) == 1 and columns[0] >= SHAPES
        elif slider.group == "Position":
            assert list(columns) == [TRANSLATION + int(slider.id[-1])]
        elif slider.group == "Rotation":
            assert set(columns) <= set(range(ROTATION, ROTATION + 4))
        before, after = (Assembly((other, which)).sdf(points) for which in (part, edited))
        assert np.abs(after - before).max() > 1e-3, slider.id


def test_an_edit_leaves_the_field_elsewhere_alone(rng: np.random.Generator) -> None:
    edits = session()
    ref, last = first(edits), edits.refs()[-1]
    centre = edits.state.assemblies[0].transform.to_mesh([edits.part(last).pose.translation])
    points = centre + rng.uniform(-0.05, 0.05, (200, 3))
    before = edits.state.assemblies[0].sdf(points)
    edits.editor.set_value(ref, "size.2", 0.6)
    assert (edits.state.assemblies[0].sdf(points) == before).all()
    assert edits.state.assemblies[0].primitives[1:] == chain().primitives[1:]


@pytest.mark.parametrize(
    ("value", "expected"), [(-1.0, 0.0), (0.25, 0.25), (7.0, 1.0)], ids=["below", "within", "above"]
)
def test_values_become_legal(value: float, expected: float) -> None:
    part = with_value(primitive("superfrustum", "a", (0.0, 0.0, 0.0)), "roundness", value)
    assert part.parameters["roundness"] == expected


def test_unknown_and_infinite_values_are_refused() -> None:
    part = primitive("cuboid", "a", (0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="nothing called 'taper'"):
        with_value(part, "taper", 1.0)
    with pytest.raises(InputError, match="finite"):
        with_value(part, "size.0", float("nan"))


def test_undo_and_redo_restore_the_very_same_bytes() -> None:
    edits = session()
    ref = edits.refs()[1]
    states = [edits.state.assemblies[0].to_json()]
    steps = [
        lambda: edits.editor.set_value(ref, "size.1", 0.123456789),
        lambda: edits.editor.set_value(ref, "rotation.1", 120.0),
        lambda: edits.editor.set_blend(ref, 0.07),
        lambda: edits.editor.set_parameter(ref, "size", (0.1, 0.2, 0.3)),
        lambda: edits.editor.move(ref, (0.1, 0.0, -0.2)),
        lambda: edits.editor.rotate(ref, (10.0, 20.0, 30.0)),
        lambda: edits.editor.scale(ref, 1.5),
        lambda: edits.editor.scale(ref, (1.0, 2.0, 0.5)),
        lambda: edits.duplicate(ref),
        lambda: edits.add(0, "superquadric", (0.1, 0.2, 0.3)),
        lambda: edits.delete(first(edits)),
        lambda: edits.rename(ref, "another name"),
    ]
    for step in steps:
        step()
        edits.commit()
        states.append(edits.state.assemblies[0].to_json())
    assert len(set(states)) == len(states)
    for expected in reversed(states[:-1]):
        assert edits.undo()
        assert edits.state.assemblies[0].to_json() == expected
    assert not edits.undo()
    for expected in states[1:]:
        assert edits.redo()
        assert edits.state.assemblies[0].to_json() == expected
    assert not edits.redo()


def test_a_drag_is_one_step_and_one_there_and_back_is_none() -> None:
    edits = session()
    original = edits.state
    for value in np.linspace(0.3, 0.5, 20):
        edits.editor.set_value(first(edits), "size.0", value)
    assert edits.commit() and edits.changed
    edits.undo()
    assert edits.state is original and not edits.changed
    edits.editor.set_value(first(edits), "size.0", 0.9)
    edits.editor.set_value(first(edits), "size.0", 0.3)
    assert not edits.commit()
    assert edits.state is original and edits.can_redo


def test_undo_ends_an_edit_that_goes_on_and_forgets_the_future() -> None:
    edits = session()
    edits.editor.set_value(first(edits), "size.0", 0.9)
    assert edits.can_undo and edits.undo() and not edits.can_undo
    edits.editor.set_value(first(edits), "size.0", 0.8)
    edits.commit()
    assert not edits.redo()


def test_hide_isolate_and_show_all_are_undone() -> None:
    edits = session()
    a, b, *_ = edits.refs()
    edits.hide(a)
    assert [part.name for part in edits.state.shown_assembly(0).primitives] == [
        ref.name for ref in edits.refs()[1:]
    ]
    edits.isolate(b)
    assert edits.state.hidden == frozenset(edits.refs()) - {b}
    edits.isolate(b)
    assert not edits.state.hidden and edits.state.shown_assembly(0) is edits.state.assemblies[0]
    edits.undo()
    edits.undo()
    assert edits.state.hidden == {a}


def test_names_of_copies_and_new_parts_are_free() -> None:
    edits = session()
    ref = edits.rename(first(edits), "leg_09")
    assert [edits.duplicate(ref).name, edits.duplicate(ref).name] == ["leg_10", "leg_11"]
    assert edits.duplicate(edits.rename(edits.refs()[-1], "x" * 128)).name == "x" * 126 + "_1"
    assert edits.add(0, "cuboid").name == "part_07" and edits.selected == PartRef(0, "part_07")
    with pytest.raises(AssemblyError, match="names must differ"):
        edits.rename(ref, edits.refs()[3].name)
    with pytest.raises(InputError, match="no part"):
        edits.hide(PartRef(0, "nobody"))


def test_selection_follows_renames_and_leaves_with_its_part() -> None:
    edits = session()
    edits.select(first(edits))
    edits.hide(first(edits))
    assert edits.rename(first(edits), "new") == edits.selected == PartRef(0, "new")
    assert PartRef(0, "new") in edits.state.hidden
    edits.undo()
    assert edits.selected is None
    edits.select(first(edits))
    edits.delete(first(edits))
    assert edits.selected is None


def test_several_assemblies_are_edited_apart() -> None:
    edits = EditSession([chain(), chain()])
    assert len(edits.refs()) == 8 and len(edits.refs(1)) == 4
    edits.editor.set_value(edits.refs(1)[0], "size.0", 0.9)
    assert edits.state.assemblies[0] == chain() != edits.state.assemblies[1]


def test_angles_beyond_a_quarter_turn_stay_while_they_are_dragged() -> None:
    edits = session()
    ref = first(edits)
    for angle in range(0, 180, 7):
        edits.editor.set_value(ref, "rotation.1", float(angle))
        assert [slider.value for slider in edits.editor.sliders(ref) if slider.group == "Rotation"] == [
            0.0,
            float(angle),
            0.0,
        ]


def test_angles_and_quaternions_agree(rng: np.random.Generator) -> None:
    for angles in rng.uniform(-85.0, 85.0, (50, 3)):
        x, y, z = (float(value) for value in angles)
        np.testing.assert_allclose(to_angles(to_quaternion((x, y, z))), angles, atol=1e-9)


def test_placing_by_a_matrix_turns_moves_and_stretches() -> None:
    part = primitive("superfrustum", "a", (0.1, 0.2, 0.3))
    part = replace(part, pose=Pose(part.pose.translation, to_quaternion((30.0, 40.0, 50.0))))
    assert placed(part, pose_matrix(part.pose)) == part
    matrix = pose_matrix(Pose((0.5, 0.0, 0.0), to_quaternion((0.0, 90.0, 0.0)))) @ np.diag(
        [2.0, 1.0, 0.5, 1.0]
    )
    moved = placed(part, matrix)
    assert moved.parameters["size"] == (1.0, 0.5, 0.25) and moved.pose.translation == (0.5, 0.0, 0.0)
    np.testing.assert_allclose(moved.pose.matrix(), matrix[:3, :3] / [2.0, 1.0, 0.5], atol=1e-6)
    with pytest.raises(InputError, match="inside out"):
        placed(part, np.diag([-1.0, 1.0, 1.0, 1.0]))


def test_the_model_needs_no_vtk() -> None:
    code = "import sys, resfit.viewer.open_view, resfit.viewer.desktop.panel_layout;"
    code += " assert 'vtkmodules' not in sys.modules"
    assert run([sys.executable, "-c", code], check=False, timeout=60).returncode == 0
