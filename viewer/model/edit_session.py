"""Editing without a window: one or several assemblies, what is selected and hidden, undo and redo.

Assemblies are never changed, only replaced: a step of undo is the very object that was there before, and so are the
bytes of its file. All places and lengths are in each assembly's normalised frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ...assembly.assembly import Assembly
from ...assembly.colors import palette_color
from ...assembly.primitive import Pose, Primitive, Vector
from ...kernels.primitives import family
from .edit_state import PartRef, State
from .part_editor import PartEditor
from .undo import UndoStack


class EditSession:
    """Assemblies that are edited.

    Changes show at once in `state`; `commit` makes all since the last one a single step of undo, so that a whole drag
    of a slider is one. The methods here end an edit by themselves and commit; those of `editor` do not.

    Attributes:
        state: assemblies and visibility as they are now.
        selected: the part that sliders and keys act on, or None.
        editor: sets the numbers of parts.
    """

    def __init__(self, assemblies: Sequence[Assembly]) -> None:
        """Begin with assemblies as they were read."""
        self.state = State(tuple(assemblies))
        self.selected: PartRef | None = None
        self.editor = PartEditor(lambda: self.state, self._put)
        self._steps = UndoStack(self.state)
        self._saved = self.state.assemblies

    def refs(self, item: int | None = None) -> list[PartRef]:
        """All parts in their order, or those of one assembly."""
        return self.state.refs(item)

    def part(self, ref: PartRef) -> Primitive:
        """The part itself, in the normalised frame of its assembly.

        Raises:
            InputError: if there is no such part.
        """
        return self.state.part(ref)

    @property
    def changed(self) -> bool:
        """Dirty flag: True if an assembly differs from what was opened or last saved."""
        return any(now is not was for now, was in zip(self.state.assemblies, self._saved, strict=True))

    def mark_saved(self) -> None:
        """Say that the assemblies lie in their files as they are now."""
        self._saved = self.state.assemblies

    # Undo

    @property
    def can_undo(self) -> bool:
        """True if there is a step to go back."""
        return self._steps.can_undo(self.state)

    @property
    def can_redo(self) -> bool:
        """True if there is a step to go forward."""
        return self._steps.can_redo

    def commit(self) -> bool:
        """Make all changes since the last commit one step of undo; False if there are none."""
        changed = self._steps.commit(self.state)
        self.state = self._steps.committed
        return changed

    def undo(self) -> bool:
        """Go one step back; False if there is none."""
        self.commit()
        return self._went(self._steps.undo())

    def redo(self) -> bool:
        """Go one step forward again; False if there is none."""
        self.commit()
        return self._went(self._steps.redo())

    # Which part

    def select(self, ref: PartRef | None) -> None:
        """Choose the part that is edited, or none; no step of undo.

        Raises:
            InputError: if there is no such part.
        """
        if ref is not None:
            self.state.index(ref)
        self.commit()
        self.selected = ref

    def hide(self, ref: PartRef, hidden: bool | None = None) -> None:
        """Hide a part or show it again; the other way round than now unless told."""
        self.state.index(ref)
        before = self.state.hidden
        hide = ref not in before if hidden is None else hidden
        self._finish(self.state.with_hidden(before | {ref} if hide else before - {ref}))

    def isolate(self, ref: PartRef) -> None:
        """Hide all other parts; show all again if it is alone already."""
        others = frozenset(self.refs()) - {ref}
        alone = self.state.hidden == others
        self._finish(self.state.with_hidden(() if alone else others))

    def show_all(self) -> None:
        """Hide nothing."""
        self._finish(self.state.with_hidden(()))

    # Parts that come, go and change their names

    def duplicate(self, ref: PartRef) -> PartRef:
        """Put a copy of a part behind it in the order of the union, and select it."""
        part, index = self.part(ref), self.state.index(ref)
        copy = replace(part, name=self.state.free_name(ref.item, part.name))
        return self._insert(ref.item, index + 1, copy)

    def add(self, item: int, family_name: str, place: Vector = (0.0, 0.0, 0.0)) -> PartRef:
        """Add a primitive with its family's default numbers at the end of the union, and select it.

        Raises:
            AssemblyError: if there is no such family.
        """
        entry = family(family_name)
        count = len(self.state.assemblies[item].primitives)
        values: dict[str, Any] = {
            parameter.name: parameter.default if parameter.count > 1 else parameter.default[0]
            for parameter in entry.parameters
        }
        name = self.state.free_name(item, f"part_{count:02d}")
        part = Primitive(family_name, name, Pose(place), values, 0.0, palette_color(count))
        return self._insert(item, count, part)

    def delete(self, ref: PartRef) -> None:
        """Take a part away."""
        state = self.state.without(ref)
        if self.selected == ref:
            self.selected = None
        self._finish(state)

    def rename(self, ref: PartRef, name: str) -> PartRef:
        """Give a part another name.

        Raises:
            AssemblyError: if another part has it, or it is no name.
        """
        self._put(ref, replace(self.part(ref), name=name))
        new, state = PartRef(ref.item, name), self.state
        if ref in state.hidden:
            state = state.with_hidden(state.hidden - {ref} | {new})
        if self.selected == ref:
            self.selected = new
        self._finish(state)
        return new

    # How

    def _put(self, ref: PartRef, part: Primitive) -> None:
        self.state = self.state.with_part(ref, part)

    def _finish(self, state: State) -> None:
        self.state = state
        self.commit()

    def _insert(self, item: int, index: int, part: Primitive) -> PartRef:
        self.commit()
        self._finish(self.state.with_inserted(item, index, part))
        self.selected = PartRef(item, part.name)
        return self.selected

    def _went(self, moved: bool) -> bool:
        self.state = self._steps.committed
        if self.selected is not None and self.selected not in self.refs():
            self.selected = None
        return moved
