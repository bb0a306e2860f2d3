"""Compiling ahead: every kernel module, run once on next to nothing."""

from __future__ import annotations

import time

import numpy as np
import warp as wp

from .contour.isosurface import extract_isosurface
from .field.adjoint import differentiable_union
from .field.containment_count import count_containing
from .field.culling import bound_blocks, cull
from .field.evaluate import primitives_at, union_at
from .field.gradient import union_gradient_at
from .field.jacobian import jacobian
from .field.points import point_blocks
from .field.primitive_set import PrimitiveSet
from .grid.distance_grid import signed_distance_transform
from .grid.morphology import deepest_core
from .grid.sparse_cells import cells_of, squared_distances
from .mesh.mesh_grid import signed_distance_grid
from .mesh.mesh_query import MeshQuery
from .mesh.mesh_rows import measure_band
from .mesh.solid_angles import summed_winding_numbers
from .primitives import FAMILIES
from .refine.levenberg_step import Damping, advance, judge_alone, judge_together, step_state
from .refine.nearest_primitives import find_owners, list_candidates, nearest_primitive_arrays
from .refine.normal_equations import normal_equations
from .refine.point_batches import point_batches
from .refine.prune_lists import prune_lists
from .refine.residual_points import contributions, drop_blocks, residual_points, weigh_points
from .refine.residual_rows import RowSorter
from .refine.residuals import RESIDUAL_COUNT
from .render.camera import frame_bounds
from .render.raytrace import render_assembly, render_mesh
from .rows import SHAPE, SHAPES, empty_rows
from .runtime.launch import serial_device
from .select.blend_search import BlendTrials
from .select.containment import PointContainment
from .select.coverage_gains import CoverageCounts, MarginalGains
from .select.coverage_sets import CandidateCoverage
from .select.objective_sums import Prices
from .select.swap_moves import replace_members


def precompile_kernels(device: wp.Device) -> float:
    """Compile or load everything on `device`, and say how many seconds that took: next to none from the cache."""
    begin = time.perf_counter()
    points = np.linspace(-0.9, 0.9, 3 * 64).reshape(-1, 3)
    for name, entry in FAMILIES.items():
        rows = empty_rows(1)
        rows[0, SHAPES:-2] = entry.shape_row()
        _warm_primitives(PrimitiveSet(rows, [name], device, requires_grad=True), points)
        _warm_selection(PrimitiveSet(rows, [name], device), points)
    _warm_grids(device)
    return time.perf_counter() - begin


def _warm_primitives(primitives: PrimitiveSet, points: np.ndarray) -> None:
    blocks = point_blocks(points, primitives.device)
    primitives_at(primitives, blocks)
    union_at(primitives, blocks, lists=cull(primitives, blocks))
    union_gradient_at(primitives, blocks)
    count_containing(primitives, blocks, bound_blocks(blocks))
    jacobian(primitives, points, np.zeros(len(points)))
    tape = wp.Tape()
    field = differentiable_union(primitives, blocks, tape)
    tape.backward(grads={field: wp.ones_like(field, requires_grad=False)})
    extract_isosurface(primitives, 8)
    camera = frame_bounds(np.full(3, -1.0), np.full(3, 1.0))
    render_assembly(primitives, np.ones((1, 3)), camera, 16, 12, samples=1)
    owned = point_batches(points, np.zeros(len(points)), 1, np.zeros(len(points)), device=primitives.device)
    normal_equations(primitives, owned, 30.0)
    _warm_refinement(primitives, points)


def _warm_selection(primitives: PrimitiveSet, points: np.ndarray) -> None:
    coverage = CandidateCoverage(len(points), serial_device())
    coverage.append(PointContainment(points, primitives.device).masks(primitives))
    coverage.common([0])
    counts = CoverageCounts(coverage, np.zeros(len(points)), np.ones(len(points)))
    additions = MarginalGains(counts)
    counts.count(0, 1)
    additions.update()
    replace_members(counts, [0], [0], Prices(1.0, 1.0, 0.0, 0.0, 0.0))
    some = np.zeros(2)
    BlendTrials(np.ones((2, 2)), some, 0.1, 1, some, some, some, serial_device()).sums_of(1, [0.0])


def _warm_refinement(primitives: PrimitiveSet, points: np.ndarray) -> None:
    shown = residual_points(points, np.zeros(len(points)), np.ones(len(points)), primitives.device)
    owners, found = nearest_primitive_arrays(1, shown.blocks, shown.bounds), contributions(1, shown)
    betas = wp.full(1, 30.0, dtype=float, device=primitives.device)
    list_candidates(primitives, shown.blocks, shown.bounds, betas, owners)
    find_owners(primitives, shown.blocks, owners)
    drop_blocks(shown, owners, betas)
    prune_lists(primitives, shown.blocks, betas, owners)
    weights = (1.0,) * RESIDUAL_COUNT
    weigh_points(shown, owners, 1, betas, weights, found)
    RowSorter(1, shown, owners, found, weights).sort()
    state = step_state(primitives.rows_numpy(), np.zeros(SHAPE), np.ones(SHAPE), primitives.device)
    judge_alone(state, 1, Damping(0.5, 2.0, 1e-6))
    judge_together(state, 1, found.loss, Damping(0.5, 2.0, 1e-6))
    advance(state, primitives)


def _warm_grids(device: wp.Device) -> None:
    vertices = 0.8 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32)
    grid = signed_distance_grid(MeshQuery(vertices, faces, device), 16)
    measure_band(MeshQuery(vertices, faces, device), 16, 0.2)
    summed_winding_numbers(MeshQuery(vertices, faces, device), point_blocks(vertices, device))
    camera = frame_bounds(np.full(3, -1.0), np.full(3, 1.0))
    render_mesh(vertices, faces, camera, 16, 12, samples=1, device=device)
    inside = wp.array(grid.distance.numpy() < 0, dtype=wp.bool, device=device)
    signed_distance_transform(inside)
    solid = cells_of(np.ones((4, 4, 4), bool))
    deepest_core(solid, np.ones(len(solid), np.float32), 1)
    solid.run_lengths()
    squared_distances(solid.index, solid.index, serial_device())
