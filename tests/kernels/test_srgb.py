"""The transfer function of sRGB and its inverse."""

from __future__ import annotations

import numpy as np
import pytest

from resfit.assembly.colors import linear_rgb
from resfit.kernels.srgb import to_linear, to_srgb


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_one_undoes_the_other(dtype: type) -> None:
    shown = np.linspace(0.0, 1.0, 256, dtype=dtype)
    light = to_linear(shown)
    assert light.dtype == dtype and (np.diff(light) > 0.0).all()
    np.testing.assert_allclose(to_srgb(light), shown, atol=1e-6)
    assert to_linear(np.array(0.5)) == pytest.approx(0.21404, abs=1e-5)
    assert linear_rgb("#ff8000") == pytest.approx((1.0, 0.21586, 0.0), abs=1e-5)
