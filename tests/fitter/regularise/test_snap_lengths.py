"""Sizes and coordinates that are nearly equal, made equal to the last bit."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest

from resfit.fitter.objective.cached import CachedObjective
from resfit.fitter.regularise.constraints import Constraints, Copied
from resfit.fitter.regularise.snap_lengths import NEAR_PLACE, NEAR_SIZE, snap_centres, snap_sizes
from resfit.fitter.regularise.transaction import Transaction
from resfit.kernels.rows import SHAPES, TRANSLATION, empty_rows

SIZE, PLACE = slice(SHAPES, SHAPES + 3), slice(TRANSLATION, TRANSLATION + 3)


class Indifferent:
    """Judges every set of rows alike, but for those in which the forbidden number is at a place."""

    def __init__(self, forbidden: tuple[int, int, float] | None = None) -> None:
        self.forbidden = forbidden

    def families(self, rows: np.ndarray) -> list[str]:
        return ["superfrustum"] * len(rows)

    def objective(self, rows: np.ndarray) -> float:
        if self.forbidden is None:
            return 1.0
        index, column, number = self.forbidden
        return 0.0 if rows[index, column] == np.float32(number) else 1.0


def draft_of(
    sizes: list[tuple],
    places: list[tuple],
    cached_objective: Indifferent | None = None,
    constraints: Constraints | None = None,
) -> Transaction:
    rows = empty_rows(len(sizes))
    rows[:, SIZE], rows[:, PLACE] = sizes, places
    return Transaction(
        rows, cast(CachedObjective, cached_objective or Indifferent()), constraints or Constraints()
    )


APART = [(-0.5, 0.3, 0.0), (0.5, -0.3, 0.2), (0.1, 0.7, -0.4)]


def test_parts_alike_in_all_sizes_get_the_mean() -> None:
    transaction = draft_of([(0.2, 0.4, 0.8), (0.204, 0.396, 0.81), (0.5, 1.0, 1.5)], APART)
    snap_sizes(transaction)
    np.testing.assert_array_equal(transaction.rows[0, SIZE], transaction.rows[1, SIZE])
    np.testing.assert_allclose(transaction.rows[0, SIZE], [0.202, 0.398, 0.805], rtol=1e-6)
    np.testing.assert_allclose(transaction.rows[2, SIZE], [0.5, 1.0, 1.5])
    assert [(claim.kind, claim.parts, claim.what) for claim in transaction.claims] == [
        ("size", (0, 1), "all")
    ]
    assert transaction.relations()[0].value == pytest.approx([0.202, 0.398, 0.805])


def test_single_sizes_are_equal_within_and_across_parts() -> None:
    transaction = draft_of([(0.2, 0.206, 0.8), (0.203, 1.2, 1.7)], APART[:2])
    snap_sizes(transaction)
    assert transaction.rows[0, SHAPES] == transaction.rows[0, SHAPES + 1] == transaction.rows[1, SHAPES]
    assert transaction.rows[0, SHAPES] == pytest.approx(0.203)
    np.testing.assert_allclose(transaction.rows[:, SHAPES + 2], [0.8, 1.7])
    assert [relation.value for relation in transaction.relations()] == [{"length": pytest.approx(0.203)}]


def test_a_chain_of_near_sizes_ends_at_the_tolerance_of_its_least() -> None:
    step = 1.0 + 0.7 * NEAR_SIZE
    transaction = draft_of([(0.2, 0.2 * step, 0.2 * step**2)], APART[:1])
    snap_sizes(transaction)
    first, second, third = transaction.rows[0, SIZE]
    assert first == second and third == pytest.approx(0.2 * step**2)


def test_coordinates_in_a_row_and_on_the_middle_plane() -> None:
    places = [(0.3, 0.004, -0.5), (0.3 + 0.8 * NEAR_PLACE, 0.0, 0.1), (0.5, 0.2, 0.5)]
    transaction = draft_of([(0.2, 0.4, 0.8)] * 3, places)
    snap_centres(transaction)
    assert (
        transaction.rows[0, TRANSLATION]
        == transaction.rows[1, TRANSLATION]
        == pytest.approx(0.3 + 0.4 * NEAR_PLACE)
    )
    # One is on the plane y = 0 exactly: the other comes to it, not to the mean.
    np.testing.assert_array_equal(transaction.rows[:2, TRANSLATION + 1], [0.0, 0.0])
    np.testing.assert_allclose(transaction.rows[2, PLACE], [0.5, 0.2, 0.5])
    assert [relation.value["axis"] for relation in transaction.relations()] == ["x", "y"]


def test_where_a_whole_row_may_not_its_pairs_are_tried() -> None:
    """The mean of all three is forbidden to the third."""
    places = [(0.3, -0.5, 0.0), (0.306, 0.0, 0.3), (0.312, 0.5, 0.6)]
    mean = np.float32(np.mean(np.float32([0.3, 0.306, 0.312]), dtype=np.float64))
    transaction = draft_of([(0.2, 0.4, 0.8)] * 3, places, Indifferent((2, TRANSLATION, float(mean))))
    snap_centres(transaction)
    assert transaction.rows[0, TRANSLATION] == transaction.rows[1, TRANSLATION]
    assert all(len(claim.parts) == 2 for claim in transaction.claims)


def test_copies_follow() -> None:
    mirror = np.diag([-1.0, 1.0, 1.0])
    constraints = Constraints((Copied(0, 1, mirror, np.zeros(3)),))
    transaction = draft_of(
        [(0.2, 0.4, 0.8), (0.2, 0.4, 0.8), (0.202, 0.404, 0.808)], APART, constraints=constraints
    )
    snap_sizes(transaction)
    np.testing.assert_array_equal(transaction.rows[0, SIZE], transaction.rows[1, SIZE])
    np.testing.assert_array_equal(transaction.rows[0, SIZE], transaction.rows[2, SIZE])
    assert transaction.claims[0].parts == (0, 1, 2)
