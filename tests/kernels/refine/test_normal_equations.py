"""Normal equations against float64 products of finite-difference rows, and one Levenberg step that must work."""

import numpy as np
import pytest
import warp as wp
from reference import primitive, rotation_matrix
from scenes import random_rows

from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.refine.block_solve import RESIDUAL
from resfit.kernels.refine.normal_equations import SYSTEM, normal_equations
from resfit.kernels.refine.point_batches import point_batches, shared_points
from resfit.kernels.refine.soft_occupancy import soft_occupancy
from resfit.kernels.rows import ROTATION, SHAPES, TANGENT
from resfit.kernels.runtime import launch as launching

FAMILIES = ["superfrustum", "superfrustum", "cuboid", "superprimitive", "superquadric"]


def moved(row, increment):
    """A row moved by local increments: translation (3), rotation (3), shape."""
    out = row.astype(np.float64).copy()
    out[:3] += rotation_matrix(row[ROTATION : ROTATION + 4]) @ increment[:3]
    half = np.concatenate([[1.0], increment[3:6] / 2])
    w, v = row[ROTATION], row[ROTATION + 1 : ROTATION + 4]
    out[ROTATION] = w * half[0] - v @ half[1:]
    out[ROTATION + 1 : ROTATION + 4] = w * half[1:] + half[0] * v + np.cross(v, half[1:])
    out[SHAPES : SHAPES + 8] += increment[6:]
    return out


def residuals(row, family, points, target, weight, offset, beta):
    field = primitive(points, row, family) + offset
    return weight * (1 / (1 + np.exp(beta * field)) - 1 / (1 + np.exp(beta * target)))


def test_systems_agree_with_float64(device, rng):
    rows = random_rows(rng, FAMILIES)
    count, step = 3000, 1e-6
    betas = rng.uniform(15.0, 40.0, len(FAMILIES))
    points = rng.uniform(-0.9, 0.9, (count, 3)).astype(np.float32)
    owners = rng.integers(0, len(FAMILIES) - 1, count)  # the last primitive owns nothing
    target = rng.uniform(-0.1, 0.1, count).astype(np.float32)
    weight = rng.uniform(0.5, 1.5, count).astype(np.float32)
    offset = rng.uniform(-0.02, 0.0, count).astype(np.float32)
    slope = rng.uniform(0.5, 1.0, count).astype(np.float32)
    widening = rng.uniform(-0.25, 0.0, count).astype(np.float32)
    primitives = PrimitiveSet(rows, FAMILIES, device)
    owned = point_batches(points, owners, len(FAMILIES), target, weight, offset, slope, widening, device)
    found = normal_equations(primitives, owned, betas)
    assert found.shape == (len(FAMILIES), SYSTEM, SYSTEM)
    assert not found[-1].any()
    for k, family in enumerate(FAMILIES[:-1]):
        mine = owners == k
        given = [values[mine].astype(np.float64) for values in (points, target, weight, offset)]
        base = residuals(rows[k].astype(np.float64), family, *given, betas[k])
        columns = []
        for j in range(TANGENT):
            d = step * np.eye(TANGENT)[j]
            up = residuals(moved(rows[k], d), family, *given, betas[k])
            down = residuals(moved(rows[k], -d), family, *given, betas[k])
            columns.append(slope[mine] * (up - down) / (2 * step))
        points_k, target_k, weight_k, offset_k = given
        wider = residuals(rows[k], family, points_k, target_k, weight_k, offset_k + step, betas[k])
        narrower = residuals(rows[k], family, points_k, target_k, weight_k, offset_k - step, betas[k])
        columns.append(widening[mine] * (wider - narrower) / (2 * step))
        system = np.stack([*columns, base])
        expected = system @ system.T
        np.testing.assert_allclose(found[k], expected, atol=2e-3 * np.abs(expected).max())


def test_shared_points_equal_points_of_their_own(device, rng):
    """Six primitives that read two regions have the systems that they would have with copies of the points."""
    families = ["superfrustum"] * 6
    primitives = PrimitiveSet(random_rows(rng, families), families, device)
    points = rng.uniform(-1, 1, (1500, 3))
    target = rng.uniform(-0.1, 0.1, 1500)
    regions = rng.integers(0, 2, 1500)
    readers = np.array([0, 1, 1, 0, 0, 1])
    shared = normal_equations(
        primitives, shared_points(points, regions, readers, target, device=device), 20.0
    )
    copies = [np.flatnonzero(regions == reader) for reader in readers]
    owners = np.repeat(np.arange(6), [len(copy) for copy in copies])
    every = np.concatenate(copies)
    own = normal_equations(
        primitives, point_batches(points[every], owners, 6, target[every], device=device), 20.0
    )
    np.testing.assert_array_equal(shared, own)


def test_levenberg_steps_recover_a_moved_primitive(device, rng):
    """From a disturbed start, ten damped steps on these systems bring the primitive back."""
    family = ["superfrustum"]
    rows = random_rows(rng, family)
    rows[0, SHAPES : SHAPES + 8] = [0.5, 0.4, 0.9, 0.5, 0.03, 0.7, 0.3, -1.0]
    points = rng.uniform(-1, 1, (6000, 3)).astype(np.float32)
    beta = 30.0
    target = primitive(points, rows[0].astype(np.float64), family[0])
    owned = point_batches(points, np.zeros(len(points), int), 1, target, device=device)
    row = moved(rows[0], np.array([0.05, -0.04, 0.06, 0.1, -0.1, 0.1, 0.1, 0.1, -0.1, -0.2, 0, 0.2, -0.1, 0]))
    errors = []
    for _ in range(10):
        system = normal_equations(PrimitiveSet(row[None].astype(np.float32), family, device), owned, beta)[0]
        errors.append(system[RESIDUAL, RESIDUAL])
        # The onion of a solid does not show here and stays as it is.
        used = np.arange(TANGENT - 1)
        matrix = system[np.ix_(used, used)].astype(np.float64)
        matrix += np.diag(1e-3 * np.diag(matrix) + 1e-6)
        increment = np.zeros(TANGENT)
        increment[used] = -np.linalg.solve(matrix, system[used, RESIDUAL])
        row = moved(row, increment)
    assert errors[-1] < 1e-3 * errors[0]


def test_steep_points_do_not_rule_a_system(device, rng):
    """Points on an arc's centre, where a derivative is unbounded, leave the sums moderate."""
    rows = random_rows(rng, ["superfrustum"])
    rows[0, SHAPES : SHAPES + 8] = [0.3, 0.3, 0.8, 0.0, 0.0, 0.4, 0.8, -1.0]
    theta = 0.8 * np.pi / 2
    centre = np.array([0.4 / np.tan(theta), 0.0, 0.0]) + 1e-6 * rng.normal(size=(500, 3))
    points = centre @ rotation_matrix(rows[0, ROTATION : ROTATION + 4]).T + rows[0, :3]
    owned = point_batches(points, np.zeros(500, int), 1, np.zeros(500), device=device)
    found = normal_equations(PrimitiveSet(rows, ["superfrustum"], device), owned, 4.0)
    assert np.isfinite(found).all()
    assert np.abs(found).max() < 500 * 20**2


def test_no_points(device, rng):
    rows = random_rows(rng, FAMILIES)
    owned = point_batches(np.zeros((0, 3)), np.zeros(0, int), len(FAMILIES), np.zeros(0), device=device)
    assert not normal_equations(PrimitiveSet(rows, FAMILIES, device), owned, 20.0).any()
    empty = point_batches(np.zeros((0, 3)), np.zeros(0, int), 0, np.zeros(0), device=device)
    assert normal_equations(PrimitiveSet(np.zeros((0, 17)), [], device), empty, 20.0).shape == (
        0,
        SYSTEM,
        SYSTEM,
    )


def test_same_bits_on_one_core_and_two(device, rng, monkeypatch):
    if not device.is_cpu:
        pytest.skip("GPU launches are not split")
    families = ["superfrustum"] * 20
    rows = random_rows(rng, families)
    points = rng.uniform(-1, 1, (60_000, 3))
    owned = point_batches(
        points, rng.integers(0, 20, 60_000), 20, rng.uniform(-0.1, 0.1, 60_000), device=device
    )
    results = []
    for cores in (1, 2):
        monkeypatch.setattr(launching, "core_count", lambda cores=cores: cores)
        results.append(normal_equations(PrimitiveSet(rows, families, device), owned, 30.0).tobytes())
    assert results[0] == results[1]


@wp.kernel(enable_backward=False)
def apply_occupancy_kernel(distances: wp.array[float], beta: float, out: wp.array[float]):
    i = wp.tid()
    out[i] = soft_occupancy(distances[i], beta)


@pytest.mark.parametrize("beta", [1.0, 30.0, 150.0])
def test_occupancy_is_the_logistic_function(beta, device):
    """Within 5e-7 of the exact value, and no overflow."""
    distances = np.concatenate([np.linspace(-1, 1, 10001), [-1e30, -100.0, 100.0, 1e30]]).astype(np.float32)
    given = wp.array(distances, dtype=float, device=device)
    out = wp.zeros_like(given)
    wp.launch(apply_occupancy_kernel, len(distances), [given, beta], [out], device=device)
    exact = 1 / (1 + np.exp(np.clip(beta * distances.astype(np.float64), -700, 700)))
    np.testing.assert_allclose(out.numpy(), exact, atol=5e-7)
