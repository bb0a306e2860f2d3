"""Scalar functions without branches, against NumPy in float64."""

# No postponed annotations here: Warp reads the kernels' own.

import numpy as np
import warp as wp

from resfit.kernels.runtime.launch import PLAIN_OPTIONS, launch
from resfit.kernels.vector_math import atan_ratio, atan_ratio_grad, clamp_symmetric, larger, sign, smaller

MODULE = "resfit.tests.vector_math"
wp.set_module_options(PLAIN_OPTIONS, module=MODULE)
COLUMNS = 6


@wp.kernel(module=MODULE)
def evaluate_kernel(first: int, a: wp.array[float], b: wp.array[float], out: wp.array2d[float]):
    i = first + wp.tid()
    out[i, 0] = smaller(a[i], b[i])
    out[i, 1] = larger(a[i], b[i])
    out[i, 2] = sign(a[i])
    out[i, 3] = clamp_symmetric(a[i], 0.25)
    out[i, 4] = atan_ratio(a[i] * a[i])
    out[i, 5] = atan_ratio_grad(a[i] * a[i])


def test_against_numpy(device: wp.Device, rng: np.random.Generator) -> None:
    a, b = rng.uniform(-1.0, 1.0, (2, 2000)).astype(np.float32)
    out = wp.zeros((len(a), COLUMNS), dtype=float, device=device)
    given = [wp.array(numbers, dtype=float, device=device) for numbers in (a, b)]
    launch(evaluate_kernel, len(a), given, [out], device)
    found = out.numpy().T
    np.testing.assert_array_equal(found[0], np.minimum(a, b))
    np.testing.assert_array_equal(found[1], np.maximum(a, b))
    np.testing.assert_array_equal(found[2], np.where(a < 0, -1.0, 1.0))
    np.testing.assert_array_equal(found[3], np.clip(a, -0.25, 0.25))
    r = a.astype(np.float64)
    np.testing.assert_allclose(found[4], np.arctan(r) / r, atol=4e-7)
    away = np.abs(r) > 0.05
    slope = (1.0 / (1.0 + r * r) - np.arctan(r) / r) / (2.0 * r * r)
    np.testing.assert_allclose(found[5][away], slope[away], atol=5e-5)
