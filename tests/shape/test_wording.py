"""The sentence about what a mesh was found to be: number agreement, order of clauses, one word for the kind."""

from __future__ import annotations

from typing import Any

import pytest

from resfit.shape.summary import Findings, name_kind, write_sentence

NOTHING: dict[str, Any] = {
    "bodies": 1, "open_bodies": 0, "cavities": 0, "turned_faces": 0, "inverted_bodies": 0, "overlaps": False,
    "flooded_bodies": 0, "closed_holes": 0, "open_holes": 0, "dropped_faces": 0, "sheet_faces": 0,
    "thickness": 0.0,
}  # fmt: skip


@pytest.mark.parametrize(
    ("found", "kind", "sentence"),
    [
        ({}, "closed", "Closed, consistently wound mesh of 1 body; taken as it is."),
        (
            {"bodies": 3, "cavities": 1},
            "closed",
            "Closed, consistently wound mesh of 2 bodies with 1 cavity; taken as it is.",
        ),
        (
            {"inverted_bodies": 1},
            "flipped",
            "Closed, consistently wound mesh of 1 body; inside out, turned outwards.",
        ),
        (
            {"bodies": 2, "inverted_bodies": 1, "overlaps": True},
            "flipped",
            "Closed, consistently wound mesh of 2 bodies; 1 body inside out turned outwards;"
            " taken as the union of what overlaps.",
        ),
        (
            {"turned_faces": 1},
            "reoriented",
            "Closed mesh of 1 body; 1 face wound the wrong way turned over.",
        ),
        (
            {"bodies": 2, "overlaps": True},
            "union",
            "Closed, consistently wound mesh of 2 bodies; taken as the union of what overlaps.",
        ),
        (
            {"open_bodies": 1, "closed_holes": 2, "open_holes": 1},
            "winding",
            "Open mesh of 1 body with clear inside; 2 holes closed; inside is where the winding number exceeds 1/2,"
            " at 1 open rim.",
        ),
        (
            {"bodies": 3, "open_bodies": 2, "flooded_bodies": 2, "closed_holes": 1, "dropped_faces": 4},
            "winding",
            "Mesh of 3 bodies, 2 of them open with clear inside; 2 open patches found to enclose by flooding from"
            " outside; 1 hole closed; 4 faces inside or on the solid left out.",
        ),
        (
            {"sheet_faces": 1, "thickness": 0.0123456},
            "mixed",
            "Closed, consistently wound mesh of 1 body; 1 face in sheets that enclose nothing made a shell 0.0123"
            " mesh units thick.",
        ),
        (
            {"bodies": 0, "sheet_faces": 2, "thickness": 18.0},
            "shell",
            "2 faces in sheets that enclose nothing, made a shell 18 mesh units thick.",
        ),
    ],
)  # fmt: skip
def test_kind_and_sentence(found: dict[str, Any], kind: str, sentence: str) -> None:
    findings = Findings(**{**NOTHING, **found})
    assert name_kind(findings) == kind
    assert write_sentence(findings) == sentence
