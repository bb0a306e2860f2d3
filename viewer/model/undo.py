"""Undo and redo over values that never change: steps hold the very objects that were there."""

from __future__ import annotations

from typing import Generic, TypeVar

MAX_STEPS = 1000
"""States share what they have in common, so that many are cheap; without a limit a long day would still add up."""

T = TypeVar("T")


class UndoStack(Generic[T]):
    """States one after the other, and which of them is the present one.

    Attributes:
        committed: the present state, without edits that still go on.
    """

    def __init__(self, state: T) -> None:
        """Begin with a state that cannot be undone."""
        self.committed = state
        self._past: list[T] = []
        self._future: list[T] = []

    def can_undo(self, state: T) -> bool:
        """True if there is a step back from `state`, edits that still go on included."""
        return bool(self._past) or state != self.committed

    @property
    def can_redo(self) -> bool:
        """True if there is a step forward."""
        return bool(self._future)

    def commit(self, state: T) -> bool:
        """Make `state` the next step; False if it equals the present one, whose object then stays."""
        if state == self.committed:
            return False
        self._past = [*self._past[-MAX_STEPS + 1 :], self.committed]
        self._future = []
        self.committed = state
        return True

    def undo(self) -> bool:
        """Go a step back; False if there is none."""
        return self._step(self._past, self._future)

    def redo(self) -> bool:
        """Go a step forward; False if there is none."""
        return self._step(self._future, self._past)

    def _step(self, source: list[T], sink: list[T]) -> bool:
        if not source:
            return False
        sink.append(self.committed)
        self.committed = source.pop()
        return True
