"""The state of an edit: assemblies and which parts are hidden, as a value that is replaced and never changed."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

from resfit.errors import InputError

from ...assembly.assembly import Assembly
from ...assembly.primitive import MAX_NAME, Primitive, shown


class PartRef(NamedTuple):
    """A part of one of the assemblies: names are unique within each."""

    item: int
    name: str


@dataclass(frozen=True)
class State:
    """Snapshot that undo goes back to; methods that begin with `with_` give another one."""

    assemblies: tuple[Assembly, ...]
    hidden: frozenset[PartRef] = frozenset()

    def refs(self, item: int | None = None) -> list[PartRef]:
        """All parts in their order, or those of one assembly."""
        return [
            PartRef(k, part.name)
            for k, assembly in enumerate(self.assemblies)
            if item is None or k == item
            for part in assembly.primitives
        ]

    def index(self, ref: PartRef) -> int:
        """Place of a part in its assembly.

        Raises:
            InputError: if there is no such part.
        """
        if 0 <= ref.item < len(self.assemblies):
            for index, part in enumerate(self.assemblies[ref.item].primitives):
                if part.name == ref.name:
                    return index
        raise InputError(f"there is no part {shown(ref.name)} here.")

    def part(self, ref: PartRef) -> Primitive:
        """The part itself, in the normalised frame of its assembly.

        Raises:
            InputError: if there is no such part.
        """
        index = self.index(ref)
        return self.assemblies[ref.item].primitives[index]

    def shown_assembly(self, item: int) -> Assembly:
        """An assembly without its hidden parts; the same object where none is hidden."""
        assembly = self.assemblies[item]
        kept = tuple(part for part in assembly.primitives if PartRef(item, part.name) not in self.hidden)
        return assembly if len(kept) == len(assembly.primitives) else replace(assembly, primitives=kept)

    def free_name(self, item: int, wanted: str) -> str:
        """A name like `wanted` that no part has: its number at the end counts up."""
        taken = {part.name for part in self.assemblies[item].primitives}
        found = re.fullmatch(r"(.*?)(\d*)", wanted, re.DOTALL)
        stem, digits = (found[1], found[2]) if found else (wanted, "")
        number, width = int(digits[-9:] or 0), len(digits[-9:])
        name = wanted
        while name in taken:
            number += 1
            end = f"{number:0{width}d}" if width else f"_{number}"
            name = stem[: MAX_NAME - len(end)] + end
        return name

    def with_part(self, ref: PartRef, part: Primitive) -> State:
        """With another primitive in the place of a part; the same object where they are equal."""
        index, parts = self.index(ref), self.assemblies[ref.item].primitives
        if part == parts[index]:
            return self
        return self._with_parts(ref.item, (*parts[:index], part, *parts[index + 1 :]))

    def with_inserted(self, item: int, index: int, part: Primitive) -> State:
        """With one part more, at a place of an assembly."""
        parts = self.assemblies[item].primitives
        return self._with_parts(item, (*parts[:index], part, *parts[index:]))

    def without(self, ref: PartRef) -> State:
        """With one part less."""
        index, parts = self.index(ref), self.assemblies[ref.item].primitives
        fewer = self._with_parts(ref.item, parts[:index] + parts[index + 1 :])
        return fewer.with_hidden(self.hidden - {ref})

    def with_hidden(self, hidden: Iterable[PartRef]) -> State:
        """With these parts hidden and no others."""
        return replace(self, hidden=frozenset(hidden))

    def _with_parts(self, item: int, parts: tuple[Primitive, ...]) -> State:
        assemblies = list(self.assemblies)
        assemblies[item] = replace(assemblies[item], primitives=parts)
        return replace(self, assemblies=tuple(assemblies))
