"""Whole fits of small files of kinds that real tools write: what comes out is what the file means, or said not to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import resfit
from resfit.result.fit_result import FitResult

FOLDER = Path(__file__).parent / "data" / "field_inputs"


def fitted(name: str) -> FitResult:
    return resfit.fit(FOLDER / f"{name}.obj", preset="fast")


@pytest.mark.parametrize(
    ("name", "radius"), [("sphere", 10.0), ("double_shell_leak", 10.0), ("stray_triangle", 1.0)]
)
def test_balls(name: str, radius: float) -> None:
    result = fitted(name)
    (part,) = result.assembly.primitives
    assert list(part.parameters["size"]) == [0.0, 0.0, 0.0]
    # The facets of so coarse a ball lie inside it.
    assert 0.985 * radius <= part.parameters["dilation"] * result.assembly.transform.scale <= radius
    assert (name == "stray_triangle") == any("was left out" in note for note in result.input.notes)


def test_a_tube_is_one_part() -> None:
    result = fitted("hollow_cylinder")
    (part,) = result.assembly.primitives
    assert part.parameters["onion"] == pytest.approx(0.75, abs=0.01)
    assert result.metrics["filled_holes"] == 0


@pytest.mark.parametrize(("name", "holes"), [("drilled_plate", 4), ("plate_two_holes", 2)])
def test_holes_are_kept_or_said_to_be_left_out(name: str, holes: int) -> None:
    result = fitted(name)
    lower, upper = result.target.transform.to_mesh(np.stack([result.target.lower, result.target.upper]))
    grid = np.stack(np.meshgrid(*np.linspace(lower, upper, 90).T, indexing="ij"), axis=-1)
    thin = int(np.argmin(upper - lower))
    middle = np.take(grid, 45, axis=thin).reshape(-1, 3)
    from scipy.ndimage import label

    # Within the plate, away from its rim: what is empty there is a hole.
    empty = (result.assembly.sdf(middle) > 0.0).reshape(90, 90)[1:-1, 1:-1]
    kept = int(np.asarray(label(empty)[0]).max())  # type: ignore[index]
    assert kept + result.metrics["filled_holes"] == holes


def test_open_sheets_have_a_thickness_that_is_said() -> None:
    result = fitted("window_two_triangles")
    assert "2 faces in sheets that enclose nothing, made a shell" in result.input.sentence
    assert "units thick" in result.input.sentence


def test_names_and_openings_of_a_house() -> None:
    result = fitted("house")
    stems = {part.name.split(".")[0] for part in result.assembly.primitives}
    assert stems == {"slab", "front", "back"}
    assert result.metrics["filled_holes"] == 0
    assert result.metrics["iou"] > 0.99
