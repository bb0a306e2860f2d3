"""States of an edit are values: what is not changed stays the very object."""

from __future__ import annotations

from dataclasses import replace

import pytest
from viewer_scenes import chain, primitive

from resfit.errors import InputError
from resfit.viewer.model.edit_state import PartRef, State


def test_states_share_what_is_the_same() -> None:
    state = State((chain(), chain()))
    ref = state.refs(1)[2]
    assert state.with_part(ref, state.part(ref)) is state
    changed = state.with_part(ref, replace(state.part(ref), blend=0.03))
    assert changed.part(ref).blend == 0.03 and state.part(ref).blend == 0.0
    assert changed.assemblies[0] is state.assemblies[0]


def test_parts_come_and_go_with_what_is_known_of_them() -> None:
    state = State((chain(),))
    new = primitive("cuboid", state.free_name(0, "p1_cuboid"), (0.0, 0.0, 0.0))
    more = state.with_inserted(0, 1, new).with_hidden([PartRef(0, new.name)])
    assert more.index(PartRef(0, new.name)) == 1 and len(more.shown_assembly(0).primitives) == 4
    fewer = more.without(PartRef(0, new.name))
    assert fewer == state and fewer.shown_assembly(0) is fewer.assemblies[0]
    with pytest.raises(InputError, match="no part"):
        fewer.part(PartRef(1, new.name))
