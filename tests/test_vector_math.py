"""Scalar functions without branches, and the smooth minimum built on them, against NumPy in float64."""

# No postponed annotations here: Warp reads the kernels' own.

import numpy as np
import pytest
import warp as wp

from resfit.kernels.launch import PLAIN_OPTIONS, launch
from resfit.kernels.union import gated, quarter_inverse, smooth_minimum, smooth_minimum_share
from resfit.kernels.vector_math import atan_ratio, atan_ratio_grad, clamp_symmetric, larger, sign, smaller

MODULE = "resfit.tests.vector_math"
wp.set_module_options(PLAIN_OPTIONS, module=MODULE)
COLUMNS = 10


@wp.kernel(module=MODULE)
def evaluate_kernel(first: int, a: wp.array[float], b: wp.array[float], blend: float, out: wp.array2d[float]):
    i = first + wp.tid()
    quarter = quarter_inverse(blend)
    out[i, 0] = smaller(a[i], b[i])
    out[i, 1] = larger(a[i], b[i])
    out[i, 2] = sign(a[i])
    out[i, 3] = clamp_symmetric(a[i], 0.25)
    out[i, 4] = atan_ratio(a[i] * a[i])
    out[i, 5] = atan_ratio_grad(a[i] * a[i])
    out[i, 6] = smooth_minimum(a[i], b[i], blend, quarter)
    out[i, 7] = smooth_minimum_share(a[i], b[i], quarter)
    out[i, 8] = gated(a[i], 0.0)
    out[i, 9] = gated(a[i], 1.0)


def evaluated(a: np.ndarray, b: np.ndarray, blend: float, device: wp.Device) -> np.ndarray:
    """All functions (COLUMNS, n)."""
    out = wp.zeros((len(a), COLUMNS), dtype=float, device=device)
    arrays = [wp.array(numbers, dtype=float, device=device) for numbers in (a, b)]
    launch(evaluate_kernel, len(a), [*arrays, blend], [out], device)
    return out.numpy().T


@pytest.mark.parametrize("blend", [0.0, 0.1, 0.7])
def test_against_numpy(blend: float, device: wp.Device, rng: np.random.Generator) -> None:
    a, b = rng.uniform(-1.0, 1.0, (2, 2000)).astype(np.float32)
    found = evaluated(a, b, blend, device)
    np.testing.assert_array_equal(found[0], np.minimum(a, b))
    np.testing.assert_array_equal(found[1], np.maximum(a, b))
    np.testing.assert_array_equal(found[2], np.where(a < 0, -1.0, 1.0))
    np.testing.assert_array_equal(found[3], np.clip(a, -0.25, 0.25))
    r = a.astype(np.float64)
    np.testing.assert_allclose(found[4], np.arctan(r) / r, atol=4e-7)
    away = np.abs(r) > 0.05
    slope = (1.0 / (1.0 + r * r) - np.arctan(r) / r) / (2.0 * r * r)
    np.testing.assert_allclose(found[5][away], slope[away], atol=5e-5)
    near = np.maximum(blend - np.abs(a - b), 0.0)
    np.testing.assert_allclose(found[6], np.minimum(a, b) - 0.25 * near**2 / max(blend, 1e-12), atol=2e-7)
    expected = np.clip(0.5 + 0.5 * (b - a) / max(blend, 1e-12), 0.0, 1.0)
    np.testing.assert_allclose(found[7], expected, atol=2e-6)
    np.testing.assert_array_equal(found[8], 1.0)
    np.testing.assert_array_equal(found[9], a)


def test_the_smooth_minimum_deepens_by_a_quarter_of_the_blend_at_most(device: wp.Device) -> None:
    """Where both distances are 0; beyond the blend it is the plain minimum."""
    a, b = np.float32([0.0, 0.3, -0.5]), np.float32([0.0, 0.5, 0.0])
    np.testing.assert_allclose(evaluated(a, b, 0.2, device)[6], [-0.05, 0.3, -0.5], atol=1e-7)
