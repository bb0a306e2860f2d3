"""Losing vectorisation is silent and costs fifteen times: compare block kernels with scalar twins in one run."""

# No postponed annotations here: Warp reads the kernels' own.

import time

import numpy as np
import pytest
import warp as wp
from scenes import random_rows

from resfit.kernels.adjoint import differentiable_assembly, differentiable_union
from resfit.kernels.culling import every_primitive
from resfit.kernels.field import primitives_at, union_at
from resfit.kernels.frame import Frame, to_local
from resfit.kernels.gradient import union_gradient_at
from resfit.kernels.jacobian import jacobian_kernel
from resfit.kernels.launch import VECTOR_OPTIONS, launch
from resfit.kernels.normal_equations import SYSTEM, normal_equations_at
from resfit.kernels.owned_points import owned_points
from resfit.kernels.points import point_blocks
from resfit.kernels.primitive_set import PrimitiveSet
from resfit.kernels.primitives.superfrustum import SuperFrustum, sdf_superfrustum

PRIMITIVES, POINTS = 8, 16_384
SCALAR_MODULE = "resfit.tests.scalar_twin"
wp.set_module_options(VECTOR_OPTIONS, module=SCALAR_MODULE)


@wp.kernel(module=SCALAR_MODULE)
def evaluate_one_kernel(
    first: int,
    points: wp.array[wp.vec3],
    frames: wp.array[Frame],
    tables: wp.array[SuperFrustum],
    count: int,
    # outputs
    out_values: wp.array[float],
):
    """One evaluation a thread, which LLVM leaves scalar."""
    t = first + wp.tid()
    k = t / count
    p = points[t - k * count]
    x, y, z = to_local(frames[k], p[0], p[1], p[2])
    out_values[t] = sdf_superfrustum(tables[k], x, y, z)


def cpu_seconds(work, repetitions=5):
    """Least CPU time of this thread over some runs, the first of which compiles."""
    work()
    times = []
    for _ in range(repetitions):
        begin = time.thread_time()
        work()
        times.append(time.thread_time() - begin)
    return min(times)


@pytest.fixture
def scene(device, rng, monkeypatch):
    if not device.is_cpu:
        pytest.skip("a matter of the CPU's compiler")
    monkeypatch.setenv("RESFIT_THREADS", "1")
    families = ["superfrustum"] * PRIMITIVES
    primitives = PrimitiveSet(random_rows(rng, families), families, device, requires_grad=True)
    points = rng.uniform(-1, 1, (POINTS, 3)).astype(np.float32)
    return primitives, points, point_blocks(points, device)


@pytest.fixture
def scalar_forward(scene):
    """Seconds of one scalar evaluation."""
    primitives, points, _ = scene
    positions = wp.array(points, dtype=wp.vec3, device=primitives.device)
    out = wp.empty(PRIMITIVES * POINTS, dtype=float, device=primitives.device)
    inputs = [positions, primitives.frames, primitives.tables["superfrustum"], POINTS]
    seconds = cpu_seconds(
        lambda: launch(evaluate_one_kernel, PRIMITIVES * POINTS, inputs, [out], primitives.device)
    )
    return seconds / (PRIMITIVES * POINTS)


@pytest.fixture
def scalar_gradient(scene):
    """Seconds of one scalar value with all derivatives."""
    primitives, points, _ = scene
    positions = wp.array(points, dtype=wp.vec3, device=primitives.device)
    owners = wp.zeros(POINTS, dtype=int, device=primitives.device)
    values = wp.zeros(POINTS, dtype=float, device=primitives.device)
    rows = wp.zeros((POINTS, 14), dtype=float, device=primitives.device)
    inputs = [
        positions,
        owners,
        primitives.frames,
        primitives.tables["superfrustum"],
        wp.vec2i(0, PRIMITIVES),
    ]
    kernel = jacobian_kernel("superfrustum")
    return cpu_seconds(lambda: launch(kernel, POINTS, inputs, [values, rows], primitives.device)) / POINTS


def test_forward(scene, scalar_forward):
    """Ten times faster with AVX-512, five with less."""
    primitives, _, blocks = scene
    out = primitives_at(primitives, blocks)
    each = cpu_seconds(lambda: primitives_at(primitives, blocks, out)) / (PRIMITIVES * POINTS)
    assert each < scalar_forward / 2.5


def test_union(scene, scalar_forward):
    primitives, _, blocks = scene
    lists = every_primitive(primitives, blocks)
    out = union_at(primitives, blocks, lists=lists)
    each = cpu_seconds(lambda: union_at(primitives, blocks, lists=lists, out_field=out)) / (
        PRIMITIVES * POINTS
    )
    assert each < scalar_forward / 2.5


def test_union_gradient(scene, scalar_gradient):
    primitives, _, blocks = scene
    lists = every_primitive(primitives, blocks)
    each = cpu_seconds(lambda: union_gradient_at(primitives, blocks, lists=lists)) / (PRIMITIVES * POINTS)
    assert each < scalar_gradient / 2.5


def test_adjoint_forward(scene, scalar_forward):
    primitives, _, blocks = scene
    each = cpu_seconds(lambda: differentiable_union(primitives, blocks, wp.Tape())) / (PRIMITIVES * POINTS)
    assert each < scalar_forward / 2.5


def test_adjoint(scene, scalar_gradient):
    """Every primitive at every point."""
    primitives, _, blocks = scene
    tape = wp.Tape()
    _, values = differentiable_assembly(primitives, blocks, tape)
    ones = wp.ones(values.shape[0], dtype=float, device=primitives.device)
    each = cpu_seconds(lambda: tape.backward(grads={values: ones})) / (PRIMITIVES * POINTS)
    assert each < scalar_gradient / 2.5


def test_normal_equations(scene, scalar_gradient):
    """All 120 products of a point in less than a scalar gradient alone."""
    primitives, points, _ = scene
    owned = owned_points(
        points, np.arange(POINTS) % PRIMITIVES, PRIMITIVES, np.zeros(POINTS), device=primitives.device
    )
    partial = wp.zeros(owned.pair_count * SYSTEM**2, dtype=float, device=primitives.device)
    systems = wp.zeros(PRIMITIVES * SYSTEM**2, dtype=float, device=primitives.device)
    betas = wp.full(PRIMITIVES, 30.0, dtype=float, device=primitives.device)
    each = cpu_seconds(lambda: normal_equations_at(primitives, owned, betas, partial, systems)) / POINTS
    assert each < scalar_gradient / 1.5
