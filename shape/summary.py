"""One sentence about what a mesh was found to be, and what was made of it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Findings:
    """Counts of what was found in a mesh and done about it."""

    bodies: int
    """Bodies and patches that bound the solid, cavities included."""
    open_bodies: int
    """Those of them that do not close."""
    cavities: int
    turned_faces: int
    inverted_bodies: int
    overlaps: bool
    flooded_bodies: int
    """Open bodies found by flooding from outside."""
    closed_holes: int
    open_holes: int
    dropped_faces: int
    """Sheets inside or on the solid."""
    sheet_faces: int
    thickness: float
    """Of the sheets, mesh units."""


def name_kind(found: Findings) -> str:
    """One word for it; see `Solid.kind`."""
    if not found.bodies:
        return "shell"
    if found.sheet_faces:
        return "mixed"
    if found.open_bodies:
        return "winding"
    if found.turned_faces:
        return "reoriented"
    if found.inverted_bodies:
        return "flipped"
    return "union" if found.overlaps else "closed"


def write_sentence(found: Findings) -> str:
    """The sentence; what was done follows what was found."""
    if not found.bodies:
        return (
            f"{_count(found.sheet_faces, 'face')} in sheets that enclose nothing, made a shell"
            f" {found.thickness:.3g} mesh units thick."
        )
    clauses = [_describe_bodies(found)]
    if found.turned_faces:
        clauses.append(f"{_count(found.turned_faces, 'face')} wound the wrong way turned over")
    if found.inverted_bodies:
        inverted = _count(found.inverted_bodies, "body")
        clauses.append(
            f"{inverted} inside out turned outwards" if found.bodies > 1 else "inside out, turned outwards"
        )
    if found.flooded_bodies:
        clauses.append(
            f"{_count(found.flooded_bodies, 'open patch')} found to enclose by flooding from outside"
        )
    if found.closed_holes:
        clauses.append(f"{_count(found.closed_holes, 'hole')} closed")
    if found.open_holes:
        clauses.append(
            f"inside is where the winding number exceeds 1/2, at {_count(found.open_holes, 'open rim')}"
        )
    if found.overlaps:
        clauses.append("taken as the union of what overlaps")
    if found.dropped_faces:
        clauses.append(f"{_count(found.dropped_faces, 'face')} inside or on the solid left out")
    if found.sheet_faces:
        sheets = _count(found.sheet_faces, "face")
        clauses.append(
            f"{sheets} in sheets that enclose nothing made a shell {found.thickness:.3g} mesh units thick"
        )
    if len(clauses) == 1:
        clauses.append("taken as it is")
    return "; ".join(clauses) + "."


def _describe_bodies(found: Findings) -> str:
    cavities = f" with {_count(found.cavities, 'cavity')}" if found.cavities else ""
    outer = found.bodies - found.cavities
    if not found.open_bodies:
        wound = "Closed mesh" if found.turned_faces else "Closed, consistently wound mesh"
        return f"{wound} of {_count(outer, 'body')}{cavities}"
    if found.open_bodies == found.bodies:
        return f"Open mesh of {_count(outer, 'body')} with clear inside"
    return f"Mesh of {_count(outer, 'body')}{cavities}, {found.open_bodies} of them open with clear inside"


def _count(number: int, noun: str) -> str:
    """`3 bodies`, `1 face`."""
    if number == 1:
        return f"1 {noun}"
    if noun.endswith("y"):
        return f"{number} {noun[:-1]}ies"
    return f"{number} {noun}{'es' if noun.endswith('ch') else 's'}"
