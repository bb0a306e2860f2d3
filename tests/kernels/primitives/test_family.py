"""Parameter tables: rows by name, ranges, and the map from unbounded numbers to valid ones."""

from __future__ import annotations

import numpy as np
import pytest

from resfit.kernels.primitives import FAMILIES, Family, Parameter
from resfit.kernels.rows import SHAPE


def made_up() -> Family:
    """A family of a pair, a single number, and five unused columns."""
    table = (
        Parameter("pair", "", "length", (0.0, np.inf), (0.1, 2.1), (0.5, 0.7), (0.0, 1.0)),
        Parameter("one", "", "ratio", (-1.0, 1.0), (-0.5, 0.5), (0.25,), (-1.0, 1.0)),
    )
    return Family("made_up", "", table, *[None] * 5, "", lambda shape: (shape[:3], shape[:3]), "")


def test_rows_by_name() -> None:
    family = made_up()
    assert family.parameter_count == 3
    assert (family.columns("pair"), family.columns("one")) == (slice(0, 2), slice(2, 3))
    np.testing.assert_array_equal(family.shape_row(), np.float32([0.5, 0.7, 0.25, *[0.0] * (SHAPE - 3)]))
    np.testing.assert_array_equal(family.shape_row(pair=(1, 2), one=-1)[:3], [1.0, 2.0, -1.0])
    with pytest.raises(KeyError, match="made_up has no parameter bulge"):
        family.shape_row(bulge=1.0)
    with pytest.raises(KeyError, match="bulge"):
        family.columns("bulge")


def test_valid_numbers_from_raw_ones() -> None:
    """Zero is the middle of the fitted range; beyond any number is its end; unused columns stay 0."""
    family = made_up()
    np.testing.assert_allclose(family.to_valid(np.zeros(SHAPE))[:3], [1.1, 1.1, 0.0], atol=1e-6)
    np.testing.assert_allclose(family.to_valid(np.full(SHAPE, 50.0))[:3], [2.1, 2.1, 0.5], atol=1e-6)
    assert not family.to_valid(np.full(SHAPE, 50.0))[3:].any()
    # At the ends the slope would be dead: raw numbers stay where it is not.
    raw = family.to_raw(family.shape_row(pair=(0.0, 9.0)))
    np.testing.assert_allclose(raw[:2], [np.log(1e-4), -np.log(1e-4)], atol=1e-3)


@pytest.mark.parametrize("name", sorted(FAMILIES))
def test_ranges_and_defaults_agree(name: str, rng: np.random.Generator) -> None:
    family = FAMILIES[name]
    low, high = family.fit_range
    legal_low, legal_high = family.legal_range
    assert (legal_low <= low).all() and (high <= legal_high).all()
    shape = family.shape_row()
    assert (shape >= legal_low).all() and (shape <= legal_high).all()
    inner = low + (high - low) * rng.uniform(0.01, 0.99, SHAPE)
    np.testing.assert_allclose(family.to_valid(family.to_raw(inner)), inner, rtol=1e-5)
