"""Union and difference: Warp, NumPy and the definition agree; derivatives, bounds and order are right."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from resfit.kernels.field.combine import (
    DIFFERENCE,
    UNION,
    combine,
    combine_grad,
    combine_interval,
    combined,
    combined_share,
    fold,
    quarter_inverse,
    smooth_minimum_double,
)

OPERATIONS = [UNION, DIFFERENCE]


@wp.kernel
def combine_kernel(
    a: wp.array[float],
    b: wp.array[float],
    blend: wp.array[float],
    sign: float,
    out_value: wp.array[float],
    out_slopes: wp.array[wp.vec3],
    out_double: wp.array[wp.float64],
):
    i = wp.tid()
    quarter = quarter_inverse(blend[i])
    out_value[i] = combine(a[i], b[i], blend[i], quarter, sign)
    out_slopes[i] = combine_grad(a[i], b[i], quarter, sign)
    out_double[i] = smooth_minimum_double(wp.float64(a[i]), wp.float64(b[i]), wp.float64(blend[i]))


@wp.kernel
def interval_kernel(
    a: wp.array[wp.vec2],
    b: wp.array[wp.vec2],
    blend: wp.array[float],
    sign: float,
    out: wp.array[wp.vec2],
):
    i = wp.tid()
    out[i] = combine_interval(a[i], b[i], blend[i], quarter_inverse(blend[i]), sign)


def definition(a: np.ndarray, b: np.ndarray, blend: np.ndarray, sign: float) -> np.ndarray:
    """max(a, -b) for the difference, min(a, b) for the union, rounded over by a parabola of the blend's width."""
    apart = np.abs(a - b) if sign == UNION else np.abs(a + b)
    near = np.maximum(blend - apart, 0.0) ** 2 / (4.0 * np.maximum(blend, 1e-30))
    return np.minimum(a, b) - near if sign == UNION else np.maximum(a, -b) + near


def pairs(rng: np.random.Generator, count: int = 4000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    a, b = rng.uniform(-1.0, 1.0, (2, count)).astype(np.float32)
    return a, b, np.where(rng.random(count) < 0.25, 0.0, rng.uniform(0.0, 0.8, count)).astype(np.float32)


def in_warp(a: np.ndarray, b: np.ndarray, blend: np.ndarray, sign: float) -> list[np.ndarray]:
    count = len(a)
    outputs = [wp.empty(count, dtype=kind, device="cpu") for kind in (wp.float32, wp.vec3, wp.float64)]
    given = [wp.array(value, dtype=float, device="cpu") for value in (a, b, blend)]
    wp.launch(combine_kernel, count, inputs=[*given, sign], outputs=outputs, device="cpu")
    return [output.numpy() for output in outputs]


@pytest.mark.parametrize("sign", OPERATIONS)
def test_all_forms_are_the_definition(sign: float, rng: np.random.Generator) -> None:
    a, b, blend = pairs(rng)
    expected = definition(*(value.astype(np.float64) for value in (a, b, blend)), sign)
    value, _, double = in_warp(a, b, blend, sign)
    twin = np.array([combined(*entry, sign) for entry in zip(a[:, None], b[:, None], blend, strict=True)])[
        :, 0
    ]
    assert np.abs(value - expected).max() < 3e-7
    assert np.abs(twin - expected).max() < 3e-7
    if sign == UNION:
        assert np.abs(double - expected).max() < 1e-15


@pytest.mark.parametrize("sign", OPERATIONS)
def test_derivatives_are_those_of_finite_differences(sign: float, rng: np.random.Generator) -> None:
    a, b, blend = pairs(rng)
    blend = np.maximum(blend, 0.05).astype(np.float32)
    _, slopes, _ = in_warp(a, b, blend, sign)
    exact = [value.astype(np.float64) for value in (a, b, blend)]
    # Away from the edge of the blend, where the second derivative jumps.
    apart = np.abs(exact[0] - sign * exact[1])
    plain = np.abs(apart - exact[2]) > 1e-4
    for column in range(3):
        step = np.zeros((3, 1))
        step[column] = 1e-6
        higher, lower = (definition(*(exact + sign_of * step), sign) for sign_of in (1.0, -1.0))
        found = (higher - lower) / 2e-6
        assert np.abs(found - slopes[:, column])[plain].max() < 1e-5
    shares = [combined_share(*entry, sign) for entry in zip(*exact, strict=True)]
    assert np.abs(np.array(shares) - slopes[:, 0]).max() < 1e-5


@pytest.mark.parametrize("sign", OPERATIONS)
def test_intervals_hold_all_values(sign: float, rng: np.random.Generator) -> None:
    count = 500
    a, b = (np.sort(rng.uniform(-1.0, 1.0, (count, 2)), axis=1) for _ in range(2))
    blend = rng.uniform(0.0, 0.6, count)
    out = wp.empty(count, dtype=wp.vec2, device="cpu")
    given = [wp.array(value.astype(np.float32), dtype=wp.vec2, device="cpu") for value in (a, b)]
    widths = wp.array(blend.astype(np.float32), dtype=float, device="cpu")
    wp.launch(interval_kernel, count, inputs=[*given, widths, sign], outputs=[out], device="cpu")
    low, high = out.numpy().T
    for _ in range(50):
        one, two = (bounds[:, 0] + rng.random(count) * (bounds[:, 1] - bounds[:, 0]) for bounds in (a, b))
        value = definition(one, two, blend, sign)
        assert (value >= low - 1e-6).all() and (value <= high + 1e-6).all()
    # They are tight: the ends are values.
    ends = [definition(a[:, i], b[:, j], blend, sign) for i in range(2) for j in range(2)]
    assert np.abs(low - np.min(ends, axis=0)).max() < 1e-6
    assert np.abs(high - np.max(ends, axis=0)).max() < 1e-6


def test_a_difference_depends_on_the_order_and_a_union_does_not(rng: np.random.Generator) -> None:
    a, b, _ = pairs(rng, 50)
    assert np.array_equal(combined(a, b, 0.2), combined(b, a, 0.2))
    assert not np.allclose(combined(a, b, 0.2, DIFFERENCE), combined(b, a, 0.2, DIFFERENCE))
    # What is taken from itself is gone, and what is far from a solid takes nothing.
    assert (combined(a, a, 0.0, DIFFERENCE) >= 0.0).all()
    assert np.array_equal(combined(a, np.full_like(a, 9.0), 0.2, DIFFERENCE), a)


def test_a_fold_goes_from_the_first_to_the_last(rng: np.random.Generator) -> None:
    values = rng.uniform(-1.0, 1.0, (3, 20))
    expected = combined(combined(values[0], values[1], 0.3), values[2], 0.1)
    assert np.array_equal(fold(values, [0.0, 0.3, 0.1]), expected)
