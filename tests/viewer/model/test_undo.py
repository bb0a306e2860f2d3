"""Undo and redo: what a step is, what ends the future, and how far back it goes."""

from __future__ import annotations

import pytest

from resfit.viewer.model import undo
from resfit.viewer.model.undo import UndoStack


def test_steps_back_and_forth() -> None:
    stack = UndoStack("a")
    assert stack.commit("b") and stack.commit("c")
    assert stack.undo() and stack.committed == "b"
    assert stack.undo() and stack.committed == "a"
    assert not stack.undo() and stack.committed == "a"
    assert stack.can_redo and stack.redo() and stack.redo() and stack.committed == "c"
    assert not stack.can_redo and not stack.redo()


def test_a_new_step_ends_the_future() -> None:
    stack = UndoStack("a")
    stack.commit("b")
    stack.undo()
    stack.commit("c")
    assert not stack.can_redo
    assert stack.undo() and stack.committed == "a"


def test_an_equal_state_is_no_step_and_the_object_stays() -> None:
    first = [1]
    stack = UndoStack(first)
    assert not stack.commit([1]) and stack.committed is first
    assert not stack.can_undo([1])
    # An edit that still goes on can be taken back, though no step was made of it.
    assert stack.can_undo([2])


def test_the_oldest_steps_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(undo, "MAX_STEPS", 3)
    stack = UndoStack(0)
    for state in range(1, 10):
        stack.commit(state)
    assert [stack.undo() for _ in range(4)] == [True, True, True, False] and stack.committed == 6
