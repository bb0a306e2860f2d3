"""The numbers of a part, edited in any state that holds it."""

from __future__ import annotations

import pytest
from viewer_scenes import chain

from resfit.assembly.primitive import Primitive
from resfit.viewer.model.edit_state import PartRef, State
from resfit.viewer.model.part_editor import PartEditor


def test_what_is_edited_is_put_back() -> None:
    state, put = State((chain(),)), list[tuple[PartRef, Primitive]]()
    editor = PartEditor(lambda: state, lambda ref, part: put.append((ref, part)))
    ref = state.refs()[1]
    editor.set_blend(ref, 0.04)
    editor.move(ref, (0.1, 0.0, 0.0))
    assert [found for found, _ in put] == [ref, ref] and put[0][1].blend == 0.04
    moved = put[1][1].pose.translation[0] - state.part(ref).pose.translation[0]
    assert moved == pytest.approx(0.1)


def test_an_angle_beyond_a_right_one_is_remembered() -> None:
    states = [State((chain(),))]
    editor = PartEditor(lambda: states[-1], lambda ref, part: states.append(states[-1].with_part(ref, part)))
    ref = states[0].refs()[0]
    editor.set_value(ref, "rotation.1", 120.0)
    values = {slider.id: slider.value for slider in editor.sliders(ref)}
    assert values["rotation.1"] == 120.0
