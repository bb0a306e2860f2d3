"""Compiling ahead: every kernel module, run once on next to nothing."""

from __future__ import annotations

import time

import numpy as np
import warp as wp

from .adjoint import differentiable_union
from .culling import cull
from .distance_grid import signed_distance_transform
from .field import primitives_at, union_at
from .gradient import union_gradient_at
from .jacobian import jacobian
from .mesh_grid import signed_distance_grid
from .mesh_query import MeshQuery
from .normal_equations import normal_equations
from .owned_points import owned_points
from .points import point_blocks
from .primitive_set import PrimitiveSet
from .primitives import FAMILIES
from .rows import SHAPES, empty_rows


def warm_kernels(device: wp.Device) -> float:
    """Compile or load everything on `device`, and say how many seconds that took: next to none from the cache."""
    begin = time.perf_counter()
    points = np.linspace(-0.9, 0.9, 3 * 64).reshape(-1, 3)
    for name, entry in FAMILIES.items():
        rows = empty_rows(1)
        rows[0, SHAPES:-2] = entry.shape_row()
        _warm_primitives(PrimitiveSet(rows, [name], device, requires_grad=True), points)
    _warm_grids(device)
    return time.perf_counter() - begin


def _warm_primitives(primitives: PrimitiveSet, points: np.ndarray) -> None:
    blocks = point_blocks(points, primitives.device)
    primitives_at(primitives, blocks)
    union_at(primitives, blocks, lists=cull(primitives, blocks))
    union_gradient_at(primitives, blocks)
    jacobian(primitives, points, np.zeros(len(points)))
    tape = wp.Tape()
    field = differentiable_union(primitives, blocks, tape)
    tape.backward(grads={field: wp.ones_like(field, requires_grad=False)})
    owned = owned_points(points, np.zeros(len(points)), 1, np.zeros(len(points)), device=primitives.device)
    normal_equations(primitives, owned, 30.0)


def _warm_grids(device: wp.Device) -> None:
    vertices = 0.8 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32)
    grid = signed_distance_grid(MeshQuery(vertices, faces, device), 16)
    inside = wp.array(grid.distance.numpy() < 0, dtype=wp.bool, device=device)
    signed_distance_transform(inside)
