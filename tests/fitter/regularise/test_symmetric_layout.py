"""Parts tied by symmetries: which motions there are, what matches, what is copied across, what is left out."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest

from resfit.fitter.objective.cached import CachedObjective
from resfit.fitter.regularise.constraints import Constraints
from resfit.fitter.regularise.symmetric_layout import (
    Layout,
    copy_across,
    lay_out,
    motions_of,
    resolved,
    without_idle,
)
from resfit.fitter.regularise.symmetry import Symmetry
from resfit.kernels.rows import SHAPES, TRANSLATION, empty_rows

LINE = np.linspace(-0.975, 0.975, 40)
POINTS = np.stack(np.meshgrid(LINE, LINE, LINE, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)
PLACE = slice(TRANSLATION, TRANSLATION + 3)


class Boxes:
    """Judges upright boxes against a target made of some: the IoU of their union, less a price of each."""

    def __init__(self, target: np.ndarray) -> None:
        self.target = (self.values(target) < 0).any(axis=0)

    def families(self, rows: np.ndarray) -> list[str]:
        return ["cuboid"] * len(rows)

    def values(self, rows: np.ndarray) -> np.ndarray:
        away = np.abs(POINTS[None] - rows[:, None, PLACE]) - 0.5 * rows[:, None, SHAPES : SHAPES + 3]
        return away.max(axis=2)

    def objective(self, rows: np.ndarray) -> float:
        inside = (self.values(rows) < 0).any(axis=0)
        return float((inside & self.target).sum() / (inside | self.target).sum()) - 0.001 * len(rows)


def boxes(*places: tuple[float, float, float]) -> np.ndarray:
    """Rows of cubes with sides of 0.4."""
    rows = empty_rows(len(places))
    rows[:, PLACE], rows[:, SHAPES : SHAPES + 3] = places, 0.4
    return rows


def judge_of(rows: np.ndarray) -> CachedObjective:
    return cast(CachedObjective, Boxes(rows))


def plane(axis: int) -> Symmetry:
    return Symmetry(f"symmetry about {'xyz'[axis]}", 1, np.eye(3)[axis], np.zeros(3), 0.0)


def quarter_turns() -> Symmetry:
    return Symmetry("4-fold symmetry about z", 4, np.eye(3)[2], np.zeros(3), 0.0)


FOUR = [(x, y, 0.0) for x in (0.5, -0.5) for y in (0.5, -0.5)]


def test_motions_are_the_group_without_the_identity() -> None:
    assert motions_of([]) == []
    assert len(motions_of([plane(0)])) == 1
    assert len(motions_of([quarter_turns()])) == 3
    # The square's symmetries; and all of the cube's that keep its axes as they are.
    assert len(motions_of([plane(0), quarter_turns()])) == 7
    assert len(motions_of([plane(0), plane(1), plane(2)])) == 7
    assert motions_of([plane(0), quarter_turns()], most=6) == []


def test_a_plane_off_the_origin_shifts() -> None:
    found = Symmetry("symmetry about x", 1, np.array([1.0, 0.0, 0.0]), np.array([0.25, 0.0, 0.0]), 0.0)
    ((turn, shift),) = motions_of([found])
    np.testing.assert_allclose(turn @ [1.0, 2.0, 3.0] + shift, [-0.5, 2.0, 3.0])


def test_images_that_match_are_tied_exactly() -> None:
    rows = boxes((0.5, 0.0, 0.0), (-0.52, 0.03, 0.0), (0.02, 0.6, 0.0))
    layout = lay_out(rows, motions_of([plane(0)]), judge_of(rows), set())
    assert [(copy.source, copy.index) for copy in layout.constraints.copies] == [(0, 1)]
    assert set(layout.constraints.astride) == {2} and layout.alone == ()
    np.testing.assert_array_equal(layout.rows[1, PLACE], [-0.5, 0.0, 0.0])
    # What lies across the plane comes to lie in its middle.
    np.testing.assert_allclose(layout.rows[2, PLACE], [0.0, 0.6, 0.0], atol=1e-7)
    assert layout.origin == (0, 1, 2)


def test_a_missing_partner_is_made_or_the_part_dropped() -> None:
    rows = boxes(*FOUR[:3])
    layout = lay_out(rows, motions_of([plane(0), plane(1)]), judge_of(rows), set())
    assert [index for index, _ in layout.alone] == [0]
    ((index, missing),) = layout.alone
    np.testing.assert_allclose(missing[0][0] @ rows[index, PLACE], FOUR[3])
    gone, grown = resolved(layout, judge_of(rows), 4)
    assert len(gone.rows) == 0 and len(grown.rows) == 4
    np.testing.assert_array_equal(grown.rows[3, PLACE], FOUR[3])
    assert grown.alone == () and grown.origin == (0, 1, 2, 0)
    # Without room for one more there is one way out only.
    assert len(resolved(layout, judge_of(rows), 3)) == 1


def test_fixed_parts_stay_out_of_it() -> None:
    rows = boxes(*FOUR)
    layout = lay_out(rows, motions_of([plane(0)]), judge_of(rows), {0, 2})
    assert [(copy.source, copy.index) for copy in layout.constraints.copies] == [(1, 3)]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_one_side_is_copied_onto_the_other(side: float) -> None:
    rows = boxes((0.6, 0.0, 0.0), (-0.5, 0.1, 0.0), (0.05, 0.7, 0.0))
    layout = copy_across(rows, [plane(0)], (side,), judge_of(rows), set(), 3)
    assert layout is not None and len(layout.rows) == 3
    kept = 0 if side > 0 else 1
    assert layout.origin == (kept, 2, kept)
    np.testing.assert_array_equal(layout.rows[2, PLACE], layout.rows[0, PLACE] * (-1.0, 1.0, 1.0))
    np.testing.assert_allclose(layout.rows[1, PLACE], [0.0, 0.7, 0.0], atol=1e-7)
    assert copy_across(rows, [plane(0)], (side,), judge_of(rows), set(), 2) is None


def test_idle_parts_go_with_their_copies() -> None:
    rows = boxes((0.6, 0.0, 0.0), (-0.6, 0.0, 0.0), (0.0, 0.7, 0.7), (0.0, -0.7, 0.7))
    layout = lay_out(rows, motions_of([plane(0), plane(1)]), judge_of(rows), set())
    left = without_idle(layout, judge_of(rows[:2]))
    np.testing.assert_allclose(np.abs(left.rows[:, PLACE]), [[0.6, 0.0, 0.0]] * 2)
    assert [(copy.source, copy.index) for copy in left.constraints.copies] == [(0, 1)]
    whole = without_idle(layout, judge_of(rows))
    assert whole is layout
    one = Layout(rows[:1], Constraints(), (), (0,))
    assert without_idle(one, judge_of(rows[2:])) is one
