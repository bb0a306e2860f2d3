"""Axes that nearly are the mesh's, or each other's, and which of them a change may cost the objective to line up."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from resfit.fitter.objective.cached import CachedObjective
from resfit.fitter.regularise.constraints import Constraints
from resfit.fitter.regularise.snap_axes import NEAR, ROTATIONS, snap_axes
from resfit.fitter.regularise.transaction import Transaction
from resfit.kernels.primitives import family
from resfit.kernels.rotation import matrix_of
from resfit.kernels.rows import ROTATION, SHAPE, SHAPES, empty_rows


class Indifferent:
    """Judges every set of rows alike, but for those in which a given primitive has a given quaternion."""

    def __init__(self, name: str = "superfrustum", bad: tuple[int, np.ndarray] | None = None) -> None:
        self.name, self.bad = name, bad

    def families(self, rows: np.ndarray) -> list[str]:
        return [self.name] * len(rows)

    def objective(self, rows: np.ndarray) -> float:
        if self.bad is None:
            return 1.0
        index, quaternion = self.bad
        return 0.0 if np.allclose(rows[index, ROTATION : ROTATION + 4], quaternion, atol=1e-6) else 1.0


def row(turn: Rotation, size: tuple[float, float, float] = (0.3, 0.5, 0.7), **shape: float) -> np.ndarray:
    made = empty_rows(1)[0]
    made[ROTATION : ROTATION + 4] = turn.as_quat()[[3, 0, 1, 2]]
    made[SHAPES : SHAPES + SHAPE] = family("superfrustum").shape_row(size=size, **shape)
    return made


def turn(axes: str, *degrees: float) -> Rotation:
    return Rotation.from_euler(axes, np.squeeze(degrees), degrees=True)


def snapped(*rows: np.ndarray, cached_objective: Indifferent | None = None) -> Transaction:
    transaction = Transaction(
        np.stack(rows), cast(CachedObjective, cached_objective or Indifferent()), Constraints()
    )
    snap_axes(transaction)
    return transaction


def axes_of(transaction: Transaction, index: int = 0) -> np.ndarray:
    return matrix_of(transaction.rows[index, ROTATION : ROTATION + 4])


BENT = {"bulge": 0.3, "roundness": 0.4}


def test_the_rotations_of_a_cube() -> None:
    found = np.stack([matrix_of(quaternion) for quaternion in ROTATIONS])
    assert len(np.unique(found.round(9), axis=0)) == 24
    np.testing.assert_allclose(np.linalg.det(found), 1.0)
    np.testing.assert_allclose(np.abs(found).sum(axis=1), 1.0, atol=1e-12)


def test_nearly_straight_becomes_straight_and_the_rest_stays() -> None:
    near = snapped(row(turn("xyz", 3, -4, 5), **BENT))
    np.testing.assert_allclose(axes_of(near), np.eye(3), atol=1e-7)
    assert [(claim.kind, claim.what) for claim in near.claims] == [("axis", "along the mesh's axes")]
    free = turn("xyz", 25, 35, 20)
    assert np.degrees(NEAR) < 20
    transaction = snapped(row(free, **BENT))
    np.testing.assert_array_equal(transaction.rows[0], row(free, **BENT))
    assert transaction.claims == []


def test_a_box_gets_no_rotation_but_its_sizes_in_the_mesh_s_order() -> None:
    """Of a box turned by a quarter about x, y and z change places."""
    transaction = snapped(row(turn("x", 88), roundness=0.0))
    np.testing.assert_allclose(axes_of(transaction), np.eye(3))
    np.testing.assert_allclose(transaction.rows[0, SHAPES : SHAPES + 3], [0.3, 0.7, 0.5])
    # A bent one is no box: it keeps its sizes, and is turned.
    transaction = snapped(row(turn("x", 88), **BENT))
    np.testing.assert_allclose(axes_of(transaction), turn("x", 90).as_matrix(), atol=1e-6)
    np.testing.assert_allclose(transaction.rows[0, SHAPES : SHAPES + 3], [0.3, 0.5, 0.7])


def test_only_the_sweep_counts_where_the_profile_is_turned() -> None:
    """Along z within 2 degrees, but turned about it by 30."""
    transaction = snapped(row(turn("y", 2) * turn("z", 30), **BENT))
    np.testing.assert_allclose(axes_of(transaction)[:, 2], [0.0, 0.0, 1.0], atol=1e-7)
    assert [claim.value(transaction.rows) for claim in transaction.claims] == [{"axis": "z", "along": "z"}]
    assert np.degrees(np.arccos(axes_of(transaction)[0, 0])) == pytest.approx(30.0, abs=0.5)


def test_a_change_that_costs_too_much_is_not_made() -> None:
    start = row(turn("xyz", 3, -4, 5), **BENT)
    straight = Indifferent(bad=(0, np.array([1.0, 0.0, 0.0, 0.0])))
    transaction = snapped(start, cached_objective=straight)
    # All three axes may not, but the sweep alone may.
    assert [claim.value(transaction.rows) for claim in transaction.claims] == [{"axis": "z", "along": "z"}]
    np.testing.assert_allclose(axes_of(transaction)[:, 2], [0.0, 0.0, 1.0], atol=1e-7)


def test_two_slanted_parts_become_parallel() -> None:
    slanted = turn("xyz", 25, 35, 20)
    transaction = snapped(row(slanted, **BENT), row(turn("y", 3) * slanted, **BENT))
    np.testing.assert_allclose(axes_of(transaction, 1), axes_of(transaction, 0), atol=1e-6)
    np.testing.assert_array_equal(transaction.rows[0], row(slanted, **BENT))
    assert [(claim.parts, claim.what) for claim in transaction.claims] == [((0, 1), "parallel axes")]


def test_sweeps_become_parallel_where_only_they_are_near() -> None:
    """The second is turned about its sweep by 40 degrees; being straight, it may point the other way."""
    slanted = turn("xyz", 25, 35, 20)
    other = slanted * turn("y", 3) * turn("z", 40) * turn("x", 180)
    transaction = snapped(row(slanted, roundness=0.5), row(other, roundness=0.5))
    sweep = axes_of(transaction, 0)[:, 2]
    np.testing.assert_allclose(axes_of(transaction, 1)[:, 2], -sweep, atol=1e-6)
    assert [claim.what for claim in transaction.claims] == ["parallel sweeps"]
