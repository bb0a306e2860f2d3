"""Winding numbers of a mesh at points: what decides about a mesh before anything is measured.

Not differentiable.
"""

from __future__ import annotations

import warp as wp

from .launch import PLAIN_OPTIONS, launch
from .mesh_query import WINDING_ACCURACY, MeshQuery, winding_number

wp.set_module_options(PLAIN_OPTIONS)


def winding_numbers(query: MeshQuery, points: wp.array) -> wp.array:
    """How often the mesh winds round each of the points (n,) vec3, to about 0.015; (n,) float32.

    A whole number where the mesh closes; positive where its faces are counter-clockwise seen from outside.
    """
    winding = wp.empty(len(points), dtype=float, device=query.device)
    launch(
        measure_winding_kernel,
        len(points),
        [query.mesh.id, points, WINDING_ACCURACY],
        [winding],
        query.device,
        seconds_per_thread=4e-6,
    )
    return winding


@wp.kernel
def measure_winding_kernel(
    first: int,
    mesh: wp.uint64,
    points: wp.array[wp.vec3],
    accuracy: float,
    # outputs
    out_winding: wp.array[float],
):
    i = first + wp.tid()
    out_winding[i] = winding_number(mesh, points[i], accuracy)
