"""Slabs and trees of boxes, rings around holes, probes of what sticks out, parts that one can stand for."""

from __future__ import annotations

import numpy as np
import trimesh
import warp as wp
from voxel_solids import box, cells, grid, paint, share

from resfit.decomposition.coarse_grid import working_grid
from resfit.decomposition.proposals.box_tree import best_cuts, box_tree_parts
from resfit.decomposition.proposals.holes import hole_parts, rings
from resfit.decomposition.proposals.slabs import section_cuts, section_parts
from resfit.decomposition.residual import find_residual
from resfit.decomposition.target_cells import target_cells
from resfit.fitter.config import preset_config
from resfit.fitter.objective.objective import ObjectiveSamples
from resfit.fitter.objective.outside_samples import DRAWS, with_outside_samples
from resfit.fitter.propose.candidate_pool import CandidatePool
from resfit.fitter.search.context import search_context
from resfit.fitter.search.merge import mergers
from resfit.kernels.grid.sparse_cells import cells_of
from resfit.kernels.rows import SHAPES, empty_rows
from resfit.shape.target import make_target


def cylinder(radius: float, low: float, high: float) -> np.ndarray:
    """Upright cylinder at the centre of the 64^3 grid: negative inside, no exact distance."""
    x, y, z = cells()
    return np.maximum(np.sqrt(x * x + y * y) - radius, np.maximum(low - z, z - high))


def parts_of(solid: np.ndarray, find) -> list[np.ndarray]:
    residual = find_residual(target_cells(solid))
    assert residual is not None
    return [paint(part) for part in find(working_grid(residual))]


def test_cup_comes_apart_into_foot_stem_floor_and_wall() -> None:
    foot, stem = cylinder(0.4, -0.9, -0.75), cylinder(0.1, -0.75, -0.2)
    floor = cylinder(0.5, -0.2, -0.1)
    wall = np.maximum(cylinder(0.5, -0.1, 0.7), -cylinder(0.4, -0.1, 0.8))
    slabs = parts_of(grid(foot, stem, floor, wall), section_parts)
    for piece in (foot, stem, floor, wall):
        assert max(share(slab, piece < 0) for slab in slabs) > 0.9


def test_prism_has_no_cut_and_steps_have_one_each() -> None:
    prism = np.ones((20, 6, 6), bool)
    assert section_cuts(cells_of(prism), 0) == []
    steps = prism.copy()
    steps[7:, 3:] = False
    steps[14:, :, 3:] = False
    assert section_cuts(cells_of(steps), 0) == [7, 14]


def test_ring_is_as_wide_as_the_thin_wall_around_the_hole() -> None:
    section = np.ones((24, 40), bool)
    section[5:19, 4:18] = False
    section[5:19, 22:36] = False
    found = rings(section)
    assert len(found) == 2
    for ring, hole in zip(found, (section[:, 4:18], section[:, 22:36]), strict=True):
        assert hole.shape == (24, 14)
        assert not (ring & ~section).any()
        # A wall four cells wide is all of the ring, and the far side of the other hole none of it.
        assert ring[10, 18:22].all()
        assert ring.sum() < 0.75 * section.sum()
    assert not rings(np.ones((8, 8), bool))


def test_holes_of_a_plate_are_proposed() -> None:
    plate = box((-0.8, -0.4, -0.08), (0.8, 0.4, 0.08))
    x, y, _ = cells()
    holes = np.minimum.reduce([np.hypot(x - at, y) - 0.2 for at in (-0.5, 0.5)])
    found = parts_of(np.maximum(plate, -holes).astype(np.float32), hole_parts)
    assert len(found) == 2
    for ring, at in zip(
        sorted(found, key=lambda mask: np.argwhere(mask)[:, 0].mean()), (-0.5, 0.5), strict=True
    ):
        middle = np.argwhere(ring).mean(0) / 32 - 1 + 1 / 64
        np.testing.assert_allclose(middle, [at, 0, 0], atol=0.03)


def test_probes_see_what_sticks_out(device: wp.Device) -> None:
    target = make_target(trimesh.creation.box((1.0, 1.0, 0.4)), device, 64, 2000)
    near = target.samples.near
    samples = ObjectiveSamples(near.points, near.distance, near.weight, len(near.points))
    inside, out = empty_rows(2)
    inside[SHAPES : SHAPES + 8] = [1.0, 1.0, 0.4, 0.1, 0.0, 1.0, 0.0, -1.0]
    out[SHAPES : SHAPES + 8] = [0.05, 0.05, 1.6, 0.1, 0.0, 1.0, 0.0, -1.0]
    families = ["superfrustum"]
    same = with_outside_samples(samples, inside[None], families, target, 0, device)
    assert len(same.points) == len(samples.points)
    more = with_outside_samples(samples, out[None], families, target, 0, device)
    probes = more.points[len(samples.points) :]
    # A quarter of the rod is in the box, whose normalised height is 0.72 of the rod's 1.6.
    assert 0.3 * DRAWS < len(probes) < 0.8 * DRAWS
    assert (np.abs(probes[:, :2]) < 0.026).all()
    distance = more.distance[len(samples.points) :]
    assert (distance > 0.0).all()
    np.testing.assert_allclose(distance, np.abs(probes[:, 2]) - 0.36, atol=1e-3)
    again = with_outside_samples(samples, out[None], families, target, 0, device)
    assert np.array_equal(more.points, again.points) and np.array_equal(more.weight, again.weight)


def test_box_tree_cuts_a_step_once_and_a_frame_at_both_sides() -> None:
    step = np.ones((20, 10, 10), bool)
    step[12:, 4:] = False
    assert best_cuts(cells_of(step).index) == (0, [12])
    ladder = np.zeros((40, 6, 20), bool)
    ladder[:, :, :4] = ladder[:, :, 16:] = True
    ladder[10:13, 2:4] = ladder[25:28, 2:4] = True
    assert best_cuts(cells_of(ladder).index) == (2, [4, 16])
    assert best_cuts(cells_of(np.ones((8, 8, 8), bool)).index) is None


def test_box_tree_finds_the_bars_of_a_chair() -> None:
    seat = box((-0.4, -0.4, -0.05), (0.4, 0.4, 0.05))
    back = box((-0.4, 0.3, 0.05), (0.4, 0.4, 0.8))
    legs = [
        box((x - 0.06, y - 0.06, -0.8), (x + 0.06, y + 0.06, -0.05))
        for x in (-0.34, 0.34)
        for y in (-0.34, 0.34)
    ]
    found = parts_of(grid(seat, back, *legs), box_tree_parts)
    # The back and the legs under it share a box: they come off together, and apart below.
    rear = grid(back, box((-0.4, 0.3, -0.05), (0.4, 0.4, 0.05)), legs[1], legs[3])
    for piece in (legs[0], legs[2], rear):
        assert max(share(part, piece < 0) for part in found) > 0.85


def test_two_halves_of_a_box_are_merged(device: wp.Device) -> None:
    target = make_target(trimesh.creation.box((1.0, 0.6, 0.4)), device, 64, 2000)
    config = preset_config("fast")
    halves, whole = empty_rows(2), empty_rows(1)
    halves[:, SHAPES : SHAPES + 8] = [0.9, 1.08, 0.72, 0.0, 0.0, 1.0, 0.0, -1.0]
    halves[:, 0] = [-0.45, 0.45]
    whole[:, SHAPES : SHAPES + 8] = [1.799, 1.079, 0.719, 0.0, 0.0, 1.0, 0.0, -1.0]
    context = search_context(target, config, device)

    def remembering(rows: np.ndarray) -> CandidatePool:
        candidate_pool = CandidatePool(context.inside, len(context.samples.points), device)
        candidate_pool.rows = [rows]
        candidate_pool.coverage.append(context.inside(rows))
        return candidate_pool

    moves = mergers(halves, remembering(whole), config.primitive, context.tally, config.parsimony, 4)
    assert len(moves) == 1 and len(moves[0]) == 1
    np.testing.assert_array_equal(moves[0][0, SHAPES : SHAPES + 8], whole[0, SHAPES : SHAPES + 8])
    assert not mergers(whole, remembering(halves), config.primitive, context.tally, config.parsimony, 4)
