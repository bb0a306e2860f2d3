"""Editing without a window: one or several assemblies, what is selected and hidden, undo and redo.

Assemblies are never changed, only replaced: a step of undo is the very object that was there before, and so are the
bytes of its file. All places and lengths are in each assembly's normalised frame.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from ...assembly.assembly import Assembly
from ...assembly.colors import palette_color
from ...assembly.primitive import MAX_NAME, Pose, Primitive, Quaternion, Vector, shown
from ...kernels.primitives import family
from .parameters import Slider, part_sliders, with_value
from .poses import placed, scaled_parameters, to_angles, to_vector, turned
from .undo import UndoStack


class PartRef(NamedTuple):
    """A part of one of the assemblies: names are unique within each."""

    item: int
    name: str


@dataclass(frozen=True)
class State:
    """What undo goes back to."""

    assemblies: tuple[Assembly, ...]
    hidden: frozenset[PartRef] = frozenset()


class EditSession:
    """Assemblies that are edited.

    Changes show at once in `state`; `commit` makes all since the last one a single step of undo, so that a whole drag
    of a slider is one. Methods that end an edit by themselves commit.

    Attributes:
        state: assemblies and visibility as they are now.
        selected: the part that sliders and keys act on, or None.
    """

    def __init__(self, assemblies: Sequence[Assembly]) -> None:
        """Begin with assemblies as they were read."""
        self.state = State(tuple(assemblies))
        self.selected: PartRef | None = None
        self._steps = UndoStack(self.state)
        self._saved = self.state.assemblies
        # Angles are remembered beside the quaternion made of them: beyond 90 degrees about y others name it too.
        self._turned: tuple[Quaternion, Vector] | None = None

    # What is there

    def refs(self, item: int | None = None) -> list[PartRef]:
        """All parts in their order, or those of one assembly."""
        return [
            PartRef(k, part.name)
            for k, assembly in enumerate(self.state.assemblies)
            if item is None or k == item
            for part in assembly.primitives
        ]

    def index(self, ref: PartRef) -> int:
        """Place of a part in its assembly.

        Raises:
            InputError: if there is no such part.
        """
        if 0 <= ref.item < len(self.state.assemblies):
            for index, part in enumerate(self.state.assemblies[ref.item].primitives):
                if part.name == ref.name:
                    return index
        raise InputError(f"there is no part {shown(ref.name)} here.")

    def part(self, ref: PartRef) -> Primitive:
        """The part itself, in the normalised frame of its assembly.

        Raises:
            InputError: if there is no such part.
        """
        return self.state.assemblies[ref.item].primitives[self.index(ref)]

    def is_hidden(self, ref: PartRef) -> bool:
        """Whether a part is hidden."""
        return ref in self.state.hidden

    def shown_assembly(self, item: int) -> Assembly:
        """An assembly without its hidden parts; the same object where none is hidden."""
        assembly = self.state.assemblies[item]
        kept = tuple(
            part for part in assembly.primitives if PartRef(item, part.name) not in self.state.hidden
        )
        return assembly if len(kept) == len(assembly.primitives) else replace(assembly, primitives=kept)

    def sliders(self, ref: PartRef) -> tuple[Slider, ...]:
        """Everything that can be set of a part, with its values."""
        part = self.part(ref)
        return part_sliders(part, self.index(ref) == 0, self._angles(part))

    @property
    def changed(self) -> bool:
        """Whether an assembly differs from what was opened or last saved."""
        return any(now is not was for now, was in zip(self.state.assemblies, self._saved, strict=True))

    def mark_saved(self) -> None:
        """Say that the assemblies lie in their files as they are now."""
        self._saved = self.state.assemblies

    # Undo

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to go back."""
        return self._steps.can_undo(self.state)

    @property
    def can_redo(self) -> bool:
        """Whether there is a step to go forward."""
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

    def _went(self, moved: bool) -> bool:
        self.state = self._steps.committed
        if self.selected is not None and self.selected not in self.refs():
            self.selected = None
        return moved

    # Edits that go on until a commit

    def set_value(self, ref: PartRef, slider_id: str, value: float) -> None:
        """Set one number of a part: `size.0`, `taper`, `translation.2`, `rotation.1` (degrees), `blend`.

        Raises:
            InputError: if there is no such part or number.
        """
        part = self.part(ref)
        angles = self._angles(part)
        made = with_value(part, slider_id, value, angles)
        if slider_id.startswith("rotation."):
            changed = list(angles)
            changed[int(slider_id[-1])] = min(max(value, -360.0), 360.0)
            self._turned = made.pose.rotation, to_vector(changed)
        self._put(ref, made)

    def set_parameter(self, ref: PartRef, name: str, value: float | Vector) -> None:
        """Set a whole parameter of a part's family.

        Raises:
            AssemblyError: if the family has none of that name, or the value is not legal.
        """
        part = self.part(ref)
        self._put(ref, replace(part, parameters={**part.parameters, name: value}))

    def set_blend(self, ref: PartRef, blend: float) -> None:
        """Set the radius with which a part joins those before it, normalised units."""
        self._put(ref, replace(self.part(ref), blend=blend))

    def move(self, ref: PartRef, offset: npt.ArrayLike) -> None:
        """Move a part by `offset` (3,)."""
        part = self.part(ref)
        place = to_vector(np.add(part.pose.translation, offset))
        self._put(ref, replace(part, pose=Pose(place, part.pose.rotation)))

    def rotate(self, ref: PartRef, angles: Vector) -> None:
        """Turn a part about its own centre: about x, then y, then z of the normalised frame, in degrees."""
        part = self.part(ref)
        pose = Pose(part.pose.translation, turned(part.pose.rotation, angles))
        self._put(ref, replace(part, pose=pose))

    def scale(self, ref: PartRef, factors: float | npt.ArrayLike) -> None:
        """Scale a part about its centre along its own axes, by one factor for all its lengths or one an axis (3,)."""
        part = self.part(ref)
        self._put(ref, replace(part, parameters=scaled_parameters(part, factors)))

    def place(self, ref: PartRef, matrix: npt.ArrayLike, base: Primitive | None = None) -> None:
        """Move, turn and stretch a part as a gizmo says.

        Args:
            ref: which part.
            matrix: (4, 4), takes the local frame of `base` to the normalised one: a rotation with scaled columns.
            base: the part as it was when the gizmo was taken hold of; as it is now unless given.

        Raises:
            InputError: if the matrix flattens or mirrors the part.
        """
        self._put(ref, placed(base or self.part(ref), matrix))

    # Edits that are complete at once

    def select(self, ref: PartRef | None) -> None:
        """Choose the part that is edited, or none; no step of undo.

        Raises:
            InputError: if there is no such part.
        """
        if ref is not None:
            self.index(ref)
        self.commit()
        self.selected = ref

    def duplicate(self, ref: PartRef) -> PartRef:
        """Put a copy of a part behind it in the order of the union, and select it."""
        part, index = self.part(ref), self.index(ref)
        copy = replace(part, name=self._free_name(ref.item, part.name))
        self._insert(ref.item, index + 1, copy)
        return self._selected(PartRef(ref.item, copy.name))

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
        name = self._free_name(item, f"part_{count:02d}")
        self._insert(
            item, count, Primitive(family_name, name, Pose(place), values, 0.0, palette_color(count))
        )
        return self._selected(PartRef(item, name))

    def delete(self, ref: PartRef) -> None:
        """Take a part away."""
        index = self.index(ref)
        parts = self.state.assemblies[ref.item].primitives
        self._replace(ref.item, parts[:index] + parts[index + 1 :])
        self.state = replace(self.state, hidden=self.state.hidden - {ref})
        if self.selected == ref:
            self.selected = None
        self.commit()

    def rename(self, ref: PartRef, name: str) -> PartRef:
        """Give a part another name.

        Raises:
            AssemblyError: if another part has it, or it is no name.
        """
        self._put(ref, replace(self.part(ref), name=name))
        new = PartRef(ref.item, name)
        if ref in self.state.hidden:
            self.state = replace(self.state, hidden=self.state.hidden - {ref} | {new})
        if self.selected == ref:
            self.selected = new
        self.commit()
        return new

    def hide(self, ref: PartRef, hidden: bool | None = None) -> None:
        """Hide a part or show it again; the other way round than now unless told."""
        self.index(ref)
        hide = not self.is_hidden(ref) if hidden is None else hidden
        self._set_hidden(self.state.hidden | {ref} if hide else self.state.hidden - {ref})

    def isolate(self, ref: PartRef) -> None:
        """Hide all other parts; show all again if it is alone already."""
        others = frozenset(self.refs()) - {ref}
        alone = self.state.hidden == others
        self._set_hidden(frozenset() if alone else others)

    def show_all(self) -> None:
        """Hide nothing."""
        self._set_hidden(frozenset())

    # How

    def _set_hidden(self, hidden: Iterable[PartRef]) -> None:
        self.state = replace(self.state, hidden=frozenset(hidden))
        self.commit()

    def _selected(self, ref: PartRef) -> PartRef:
        self.commit()
        self.selected = ref
        return ref

    def _angles(self, part: Primitive) -> Vector:
        if self._turned is not None and self._turned[0] == part.pose.rotation:
            return self._turned[1]
        return to_angles(part.pose.rotation)

    def _put(self, ref: PartRef, part: Primitive) -> None:
        index = self.index(ref)
        parts = self.state.assemblies[ref.item].primitives
        if part != parts[index]:
            self._replace(ref.item, (*parts[:index], part, *parts[index + 1 :]))

    def _insert(self, item: int, index: int, part: Primitive) -> None:
        self.commit()
        parts = self.state.assemblies[item].primitives
        self._replace(item, (*parts[:index], part, *parts[index:]))

    def _replace(self, item: int, parts: tuple[Primitive, ...]) -> None:
        assemblies = list(self.state.assemblies)
        assemblies[item] = replace(assemblies[item], primitives=parts)
        self.state = replace(self.state, assemblies=tuple(assemblies))

    def _free_name(self, item: int, wanted: str) -> str:
        """A name like `wanted` that no part has: its number at the end counts up."""
        taken = {part.name for part in self.state.assemblies[item].primitives}
        found = re.fullmatch(r"(.*?)(\d*)", wanted, re.DOTALL)
        stem, digits = (found[1], found[2]) if found else (wanted, "")
        number, width = int(digits[-9:] or 0), len(digits[-9:])
        name = wanted
        while name in taken:
            number += 1
            end = f"{number:0{width}d}" if width else f"_{number}"
            name = stem[: MAX_NAME - len(end)] + end
        return name
