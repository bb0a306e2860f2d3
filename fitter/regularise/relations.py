"""Exact relations of parts of an assembly: told in a report, and to be kept by whoever edits them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

PLURALS = {
    "axis": "axes",
    "canonical": "canonical shapes",
    "size": "sizes",
    "centre": "centres",
    "copy": "copies",
}
"""Kinds of relations as a summary counts them; symmetries are named one by one."""


@dataclass(frozen=True)
class Relation:
    """One relation that holds exactly."""

    kind: str
    """axis, canonical, size, centre, symmetry or copy."""
    parts: tuple[int, ...]
    """Indices of the primitives, ascending."""
    value: Any
    """What they share: JSON values, lengths and coordinates in the normalised frame."""

    def describe(self, names: Sequence[str]) -> dict[str, Any]:
        """For a report: parts by their names."""
        return {"kind": self.kind, "parts": [names[index] for index in self.parts], "value": self.value}


def sum_up(relations: Sequence[Relation]) -> str:
    """`14 relations: 6 axes, 5 sizes, symmetry about x`, or nothing where there are none."""
    if not relations:
        return ""
    clauses = []
    for kind, plural in PLURALS.items():
        count = sum(relation.kind == kind for relation in relations)
        if count:
            singular = {"copies": "copy", "axes": "axis"}.get(plural, plural.removesuffix("s"))
            clauses.append(f"{count} {plural if count > 1 else singular}")
    for relation in relations:
        if relation.kind == "symmetry":
            some = "" if relation.value["complete"] else f" of {len(relation.parts)} parts"
            clauses.append(f"{relation.value['name']}{some}")
    total = len(relations)
    return f"{total} relation{'s' if total > 1 else ''}: {', '.join(clauses)}"
