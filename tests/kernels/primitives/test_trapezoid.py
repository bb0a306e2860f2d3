"""The exact distances of the plane, to a rounded rectangle and to a trapezoid, against distances to their outlines."""

# No postponed annotations here: Warp reads the kernels' own.

import numpy as np
import pytest
import warp as wp

from resfit.kernels.primitives.stages.profile import derive_profile, sdf_profile, sdf_profile_grad
from resfit.kernels.primitives.stages.trapezoid import derive_trapezoid, sdf_trapezoid, sdf_trapezoid_grad
from resfit.kernels.runtime.launch import PLAIN_OPTIONS, launch

MODULE = "resfit.tests.trapezoid"
wp.set_module_options(PLAIN_OPTIONS, module=MODULE)


@wp.kernel(module=MODULE)
def evaluate_kernel(
    first: int, points: wp.array[wp.vec2], shape: wp.vec4, rounded: int, out: wp.array2d[float]
):
    """Distance, the same with its gradient, and the gradient."""
    i = first + wp.tid()
    p = points[i]
    if rounded != 0:
        profile = derive_profile(shape[0], shape[1], shape[2])
        u, ux, uy = sdf_profile_grad(profile, p[0], p[1])
        out[i, 0] = sdf_profile(profile, p[0], p[1])
        out[i, 1] = u
        out[i, 2] = ux * wp.sign(p[0])
        out[i, 3] = uy * wp.sign(p[1])
    else:
        trapezoid = derive_trapezoid(shape[0], shape[1], shape[2], shape[3])
        g, gu, gz, _h, _m, _taper, _onion = sdf_trapezoid_grad(trapezoid, p[0], p[1])
        out[i, 0] = sdf_trapezoid(trapezoid, p[0], p[1])
        out[i, 1] = g
        out[i, 2] = gu
        out[i, 3] = gz


def evaluated(points: np.ndarray, shape: tuple, rounded: bool, device: wp.Device) -> np.ndarray:
    out = wp.zeros((len(points), 4), dtype=float, device=device)
    given = wp.array(points.astype(np.float32), dtype=wp.vec2, device=device)
    launch(evaluate_kernel, len(points), [given, wp.vec4(*shape), int(rounded)], [out], device)
    return out.numpy().T


def distance(points: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """Signed distance (n,) of points to a convex polygon (k, 2), counter-clockwise."""
    start, end = outline, np.roll(outline, -1, axis=0)
    along = end - start
    away = points[:, None] - start
    share = np.clip((away * along).sum(2) / np.maximum((along * along).sum(1), 1e-30), 0.0, 1.0)
    nearest = np.linalg.norm(away - share[:, :, None] * along, axis=2).min(axis=1)
    inside = (along[:, 0] * away[:, :, 1] - along[:, 1] * away[:, :, 0] >= 0.0).all(axis=1)
    return np.where(inside, -nearest, nearest)


def check(points: np.ndarray, found: np.ndarray, expected: np.ndarray, atol: float) -> None:
    np.testing.assert_allclose(found[0], expected, atol=atol)
    np.testing.assert_allclose(found[1], found[0], atol=1e-6)
    # Distances have gradients of length 1; where two edges are as near, either may be meant.
    np.testing.assert_allclose(np.hypot(found[2], found[3]), 1.0, atol=1e-3)


@pytest.mark.parametrize(("taper", "onion"), [(1.0, -1.0), (0.4, -1.0), (0.0, 0.0), (0.7, 0.5), (1.6, 0.2)])
def test_trapezoid(taper: float, onion: float, device: wp.Device, rng: np.random.Generator) -> None:
    inset, height = 0.5, 1.2
    h = 0.5 * height
    corners = [
        ((onion - 1) * inset, -h),
        (0.0, -h),
        ((taper - 1) * inset, h),
        ((onion * taper - 1) * inset, h),
    ]
    points = rng.uniform(-1.5, 1.5, (2000, 2))
    found = evaluated(points, (inset, height, taper, onion), False, device)
    check(points, found, distance(points, np.array(corners)), 1e-5)


@pytest.mark.parametrize("roundness", [0.0, 0.35, 1.0])
def test_rounded_rectangle(roundness: float, device: wp.Device, rng: np.random.Generator) -> None:
    """A distance to the corners' middles less the radius; inside, to the sides only (at least minus the inset)."""
    size = np.array([1.4, 0.8])
    radius = roundness * 0.5 * size.min()
    points = rng.uniform(-1.5, 1.5, (2000, 2))
    over = np.abs(points) - (0.5 * size - radius)
    expected = np.linalg.norm(np.maximum(over, 0.0), axis=1) + np.minimum(over.max(axis=1), 0.0) - radius
    found = evaluated(points, (*size, roundness, 0.0), True, device)
    check(points, found, expected, 1e-6)
    assert expected.min() > -0.4 - 1e-9
