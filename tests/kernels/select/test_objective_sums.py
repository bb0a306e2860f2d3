"""The objective by its formula, and alike for Warp and NumPy."""

# No postponed annotations here: Warp reads the kernels' own.

import numpy as np
import pytest
import warp as wp

from resfit.kernels.runtime.launch import PLAIN_OPTIONS, launch
from resfit.kernels.select.objective_sums import (
    HARD_SUMS,
    HARD_SUMS_C,
    HardPrices,
    Prices,
    Sums,
    hard_objective,
    objective,
)

MODULE = "resfit.tests.objective"
wp.set_module_options(PLAIN_OPTIONS, module=MODULE)


@wp.kernel(module=MODULE)
def judge_kernel(
    first: int,
    sums: wp.array[wp.float64],
    primitive_count: int,
    prices: HardPrices,
    # outputs
    out_worth: wp.array[wp.float64],
):
    i = first + wp.tid()
    out_worth[i] = hard_objective(sums, i * HARD_SUMS_C, primitive_count, prices)


def test_formula():
    prices = Prices(
        near_total=10.0, box_total=100.0, primitive=0.01, overlap=0.1, unoverlap=0.25, false_volume=2.0
    )
    sums = Sums(near_in=6.0, near_out=1.0, box_in=70.0, box_out=10.0, twice=8.0, bare=4.0)
    iou = 0.5 * (6 / (10 + 2 * 1) + 70 / (100 + 2 * 10))
    assert objective(sums, 3, prices) == pytest.approx(iou - 0.03 - 0.1 * 8 / 80 - 0.25 * 4 / 80)
    assert objective(Sums(*np.zeros(6)), 0, prices) == 0


def test_warp_says_what_numpy_says(device, rng):
    prices = Prices(50.0, 30.0, 0.002, 0.03, 0.25, 1.5)
    sums = rng.uniform(0, 40, (100, HARD_SUMS))
    sums[0] = 0.0
    worth = wp.empty(100, dtype=wp.float64, device=device)
    flat = wp.array(sums.ravel(), dtype=wp.float64, device=device)
    launch(judge_kernel, 100, [flat, 7, prices.argument], [worth], device)
    np.testing.assert_allclose(worth.numpy(), objective(Sums(*sums.T), 7, prices), rtol=1e-14)
