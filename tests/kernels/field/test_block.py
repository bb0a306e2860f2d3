"""One primitive over a block of points: both forms of the field, and launches over runs of families."""

# No postponed annotations here: Warp reads the kernels' own.

import numpy as np
import warp as wp
from scenes import random_rows

from resfit.kernels.field.block import BlockFloats, block_functions, launch_pairs, launch_runs
from resfit.kernels.field.evaluate import evaluate_primitives
from resfit.kernels.field.points import BLOCK, BLOCK_C, Points, point_blocks
from resfit.kernels.field.primitive_set import Primitives, PrimitiveSet
from resfit.kernels.primitives import family
from resfit.kernels.runtime.cached_kernel import cached_kernel
from resfit.kernels.runtime.launch import VECTOR_OPTIONS


@cached_kernel
def both_kernel(name):
    """Distances of a primitive, once by themselves and once with their derivatives."""
    module = f"resfit.tests.block.{name}"
    wp.set_module_options(VECTOR_OPTIONS, module=module)
    table = family(name).table
    functions = block_functions(name, BLOCK, 4)
    distances, derivatives = functions.distances, functions.derivatives
    matrix = wp.types.matrix(shape=(4, BLOCK), dtype=float)

    @wp.kernel(module=module)
    def both_forms_kernel(
        first: int,
        primitives: Primitives,
        tables: wp.array[table],  # pyright: ignore[reportInvalidTypeForm]
        points: Points,
        # outputs
        out_distance: wp.array[float],
        out_with_gradient: wp.array[float],
    ):
        k = primitives.begin + first + wp.tid()
        distance = BlockFloats()
        rows = matrix()
        distances(points, 0, primitives.frames[k], tables[k], distance)
        derivatives(points, 0, primitives.frames[k], tables[k], rows)
        for j in range(BLOCK_C):
            out_distance[k * BLOCK_C + j] = distance[j]
            out_with_gradient[k * BLOCK_C + j] = rows[0, j]

    return both_forms_kernel


def test_distances_and_derivatives_agree_with_the_field(device, rng):
    families = ["superfrustum"] * 30 + ["cuboid"] * 5 + ["superprimitive"] * 5
    primitives = PrimitiveSet(random_rows(rng, families), families, device)
    points = rng.uniform(-1, 1, (BLOCK, 3))
    out = [wp.zeros(len(families) * BLOCK, dtype=float, device=device) for _ in range(2)]
    launch_pairs(both_kernel, primitives, 1, [point_blocks(points, device).points], out, 1e-7)
    values = evaluate_primitives(primitives, points)
    for found in out:
        np.testing.assert_allclose(found.numpy().reshape(values.shape), values, atol=2e-6)


def test_runs_are_launched_in_order_or_as_given(device, rng):
    families = ["cuboid", "superfrustum", "superfrustum", "cuboid"]
    primitives = PrimitiveSet(random_rows(rng, families), families, device)
    points = point_blocks(rng.uniform(-1, 1, (BLOCK, 3)), device).points
    out = [wp.zeros(4 * BLOCK, dtype=float, device=device) for _ in range(2)]
    named = []

    def kernel(name):
        named.append(name)
        return both_kernel(name)

    launch_runs(kernel, primitives, 1, [points], out, 1e-7)
    launch_runs(kernel, primitives, 1, [points], out, 1e-7, reversed(primitives.runs[:2]))
    assert named == ["cuboid", "superfrustum", "cuboid", "superfrustum", "cuboid"]
