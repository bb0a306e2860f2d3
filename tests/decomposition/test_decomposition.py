"""Regions of known solids: what is found, what is noise, what is thin on purpose."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from scipy import ndimage
from voxel_solids import ball, box, cells, grid, paint, propose_regions, share

from resfit.decomposition.coarse_grid import coarsen, working_grid
from resfit.decomposition.proposals import msd
from resfit.decomposition.proposals.msd import peel
from resfit.decomposition.proposals.plates_and_beams import straight_parts
from resfit.decomposition.region import Region, box_table, region_from_mask, without_duplicates
from resfit.decomposition.residual import find_residual, residual_components
from resfit.decomposition.target_cells import target_cells
from resfit.fitter.propose.candidate_pool import CandidatePool
from resfit.kernels.grid.morphology import components, deepest_core, largest_components
from resfit.kernels.grid.sparse_cells import cells_of, squared_distances
from resfit.kernels.rows import empty_rows


def dumbbell() -> np.ndarray:
    return grid(
        ball((-0.5, 0, 0), 0.3), ball((0.5, 0, 0), 0.34), box((-0.5, -0.07, -0.07), (0.5, 0.07, 0.07))
    )


def peeled(solid: np.ndarray, fraction: float, device: wp.Device) -> list[np.ndarray]:
    """Masks of the parts of a 64^3 solid."""
    solid_cells = cells_of(solid < 0)
    masks = []
    for part in peel(solid_cells, -32 * solid[solid < 0].astype(np.float32), fraction, device):
        masks.append(np.zeros(solid.shape, bool))
        masks[-1][tuple(solid_cells.index[:, part])] = True
    return masks


def test_two_balls_and_a_rod_come_apart_in_order_of_thickness(device: wp.Device) -> None:
    solid = dumbbell()
    parts = peeled(solid, 0.005, device)
    rod = box((-0.2, -0.07, -0.07), (0.16, 0.07, 0.07)) < 0
    assert share(parts[0], ball((0.5, 0, 0), 0.34) < 0) > 0.9
    assert share(parts[1], ball((-0.5, 0, 0), 0.3) < 0) > 0.9
    assert share(parts[2], rod) > 0.75
    assert not (parts[0] & parts[1]).any() and not (parts[1] & parts[2]).any()


def test_torus_is_one_part(device: wp.Device) -> None:
    x, y, z = cells()
    solid = grid(np.sqrt((np.sqrt(x * x + y * y) - 0.55) ** 2 + z * z) - 0.2)
    regions = propose_regions(solid, first_round=True, device=device)
    assert regions[0].source == "solid"
    assert share(paint(regions[0]), solid < 0) == 1.0
    assert share(peeled(solid, 0.12, device)[0], solid < 0) > 0.9


def test_angle_bracket_gives_both_arms(device: wp.Device) -> None:
    post, foot = box((-0.6, -0.2, -0.6), (-0.3, 0.2, 0.6)), box((-0.6, -0.2, -0.6), (0.6, 0.2, -0.4))
    parts = peeled(grid(post, foot), 0.03, device)
    assert max(share(part, post < 0) for part in parts) > 0.7
    assert max(share(part, (foot < 0) & (post > 0)) for part in parts) > 0.7


def test_corners_of_a_box_go_with_it(device: wp.Device) -> None:
    solid = box((-0.5, -0.4, -0.3), (0.5, 0.4, 0.3)).astype(np.float32)
    parts = peeled(solid, 0.03, device)
    assert len(parts) == 1
    assert (parts[0] == (solid < 0)).all()


def test_noise_round_a_fitted_surface_is_no_residual(rng: np.random.Generator, device: wp.Device) -> None:
    solid = ball((0, 0, 0), 0.6).astype(np.float32)
    explained = (solid + (2 / 64) * rng.uniform(0.0, 0.9, solid.shape)).astype(np.float32)
    assert find_residual(target_cells(solid), explained) is None
    assert propose_regions(solid, explained, first_round=False, device=device) == []
    # A ball of a quarter of the radius less leaves a thick shell, which is no noise.
    thick = find_residual(target_cells(solid), ball((0, 0, 0), 0.45).astype(np.float32))
    assert thick is not None and thick.volume > 10_000


@pytest.mark.parametrize("thickness", [0.02, 0.04, 0.1])
def test_thin_plate_beside_what_is_explained_is_kept(thickness: float, device: wp.Device) -> None:
    resolution = 64
    at = 31.5 * 2 / resolution - 1 + 0.5 * 2 / resolution  # a layer of cell centres
    x, _, _ = cells(resolution)
    layer = float(x[32, 0, 0])
    plate = box((layer - thickness / 2, -0.5, -0.5), (layer + thickness / 2, 0.5, 0.5))
    body = ball((-0.6, 0, 0), 0.3)
    assert at < layer
    regions = propose_regions(grid(plate, body), body.astype(np.float32), first_round=False, device=device)
    assert regions
    assert share(paint(regions[0]), plate < 0) > 0.95


def test_residual_parts_are_components_largest_first(device: wp.Device) -> None:
    body, knob, peg = ball((0, 0, 0), 0.4), ball((0.7, 0, 0), 0.2), ball((-0.7, 0, 0), 0.15)
    regions = propose_regions(
        grid(body, knob, peg), body.astype(np.float32), first_round=False, device=device
    )
    components = [region for region in regions if region.source == "component"]
    assert share(paint(components[0]), knob < 0) == 1.0
    assert share(paint(components[1]), peg < 0) == 1.0
    assert [region.volume for region in regions] == sorted((r.volume for r in regions), reverse=True)


def test_proposals_are_the_same_every_time_and_differ_from_each_other(device: wp.Device) -> None:
    first, second = (propose_regions(dumbbell(), first_round=True, device=device) for _ in range(2))
    assert [region.describe() for region in first] == [region.describe() for region in second]
    assert all((a.mask == b.mask).all() for a, b in zip(first, second, strict=True))
    assert all(a.overlap(b) <= 0.9 for i, a in enumerate(first) for b in first[:i])
    assert len(propose_regions(dumbbell(), first_round=True, device=device, most=2)) == 2


@pytest.mark.parametrize("resolution", [2, 5, 9])
def test_tiny_and_empty_grids(resolution: int, device: wp.Device) -> None:
    shape = (resolution,) * 3
    assert propose_regions(np.ones(shape, np.float32), first_round=True, device=device) == []
    solid = np.full(shape, -0.5, np.float32)
    assert propose_regions(solid, solid, first_round=False, device=device) == []
    far = np.full(shape, 1e30, np.float32)
    regions = propose_regions(solid, far, first_round=True, device=device)
    assert [region.volume for region in regions] == ([resolution**3] if resolution > 2 else [])


def deepest_by_labelling(depth: np.ndarray, volume: int) -> tuple[float, np.ndarray]:
    """Threshold and labels of the deepest level with a component of `volume` cells."""
    levels = np.floor(depth * 8)
    for level in range(int(levels.max()), -1, -1):
        labels, _ = ndimage.label((levels >= level) & (depth > 0))
        if np.bincount(labels.ravel())[1:].max(initial=0) >= volume:
            return max(level, 0.5) / 8, labels
    raise AssertionError("no level has it")


def test_deepest_core_is_what_labelling_every_level_finds(
    rng: np.random.Generator, device: wp.Device
) -> None:
    depth = ndimage.gaussian_filter(rng.normal(size=(20, 17, 23)), 1.5).astype(np.float32) * 20
    solid = cells_of(depth > 0)
    for volume in (1, 7, 40, 300):
        core = deepest_core(solid, depth[depth > 0], volume)
        assert core is not None
        found = np.zeros(depth.shape, bool)
        found[tuple(solid.index[:, core.places])] = True
        threshold, labels = deepest_by_labelling(depth, volume)
        volumes = np.bincount(labels.ravel())[1:]
        assert core.threshold == threshold
        assert found.sum() == volumes.max()
        assert len(np.unique(labels[found])) == 1
    assert deepest_core(solid, depth[depth > 0], depth.size) is None


def test_coarse_grid_is_refused_where_parts_would_vanish() -> None:
    thick = find_residual(target_cells(box((-0.5, -0.4, -0.3), (0.5, 0.4, 0.3)).astype(np.float32)))
    thin = find_residual(target_cells(box((-0.6, -0.6, 0.0), (0.6, 0.6, 0.03)).astype(np.float32)))
    assert thick is not None and coarsen(thick) is not None
    assert thin is not None and coarsen(thin) is None


def test_region_names_places_and_samples_its_cells(rng: np.random.Generator) -> None:
    mask = rng.random((9, 8, 7)) < 0.3
    region = region_from_mask(np.pad(mask, 2), np.array([1, 2, 3]), 32, "component")
    assert region is not None
    assert region.volume == mask.sum() == len(region.centres())
    index = np.round((region.centres() + 1) * 16 - 0.5).astype(int) - [3, 4, 5]
    assert mask[tuple(index.T)].all()
    points = region.sample(40)
    assert points.shape == (40, 3)
    assert {tuple(p) for p in points.tolist()} <= {tuple(p) for p in region.centres().tolist()}
    assert (points == region.sample(40)).all()
    np.testing.assert_allclose(region.covariance(), np.cov(region.centres().T, bias=True), atol=1e-6)
    assert region_from_mask(np.zeros((3, 3, 3), bool), np.zeros(3), 32, "component") is None


def test_duplicates_are_dropped_and_the_first_stays() -> None:
    cube = np.ones((10, 10, 10), bool)
    shaved = cube.copy()
    shaved[0, 0] = False
    regions = [
        Region(np.array([4, 4, 4]), cube, 32, "first"),
        Region(np.array([4, 4, 4]), shaved, 32, "second"),
        Region(np.array([5, 4, 4]), cube, 32, "third"),
    ]
    assert [region.source for region in without_duplicates(regions)] == ["first", "third"]
    assert regions[0].overlap(regions[2]) == pytest.approx(900 / 1100)


def test_memory_takes_the_regions_that_are_like_none_of_its_own(device: wp.Device) -> None:
    def remembering(*regions: Region) -> CandidatePool:
        candidate_pool = CandidatePool(lambda rows: np.zeros((len(rows), 1), np.uint32), 4, device)
        candidate_pool.regions, candidate_pool.boxes = list(regions), box_table(regions)
        candidate_pool.rows = [empty_rows(1) for _ in regions]
        candidate_pool.coverage.append(candidate_pool.inside(candidate_pool.candidates()))
        return candidate_pool

    cube, hollow = np.ones((10, 10, 10), bool), np.ones((10, 10, 10), bool)
    hollow[1:, 1:, 1:] = False
    own = Region(np.array([4, 4, 4]), cube, 32, "own")
    others = [
        Region(np.array([4, 4, 4]), cube[:9], 32, "most of it"),
        Region(np.array([12, 4, 4]), cube, 32, "elsewhere"),
        Region(np.array([4, 4, 4]), hollow, 32, "its shell"),
        Region(np.array([12, 4, 5]), cube[:, :, :9], 32, "most of elsewhere"),
    ]
    candidate_pool = remembering(own)
    candidate_pool.take(remembering(*others))
    assert [region.source for region in candidate_pool.regions] == ["own", "elsewhere", "its shell"]
    assert len(candidate_pool.candidates()) == 3 and len(candidate_pool.boxes) == 3


def test_components_smaller_than_asked_are_left_out() -> None:
    residual = find_residual(target_cells(grid(ball((0, 0, 0), 0.3), ball((0.7, 0, 0), 0.08))))
    assert residual is not None
    assert len(residual_components(residual)) == 2
    assert len(residual_components(residual, smallest=100)) == 1
    assert len(residual_components(residual, most=1)) == 1


@pytest.mark.parametrize("wall", [0.05, 0.1])
def test_walls_of_one_thickness_come_apart_as_plates(wall: float) -> None:
    outer = box((-0.7, -0.6, -0.5), (0.7, 0.6, 0.5))
    inner = box((-0.7 + wall, -0.6 + wall, -0.5 + wall), (0.7 - wall, 0.6 - wall, 0.5 - wall))
    hollow = grid(np.maximum(outer, -inner))
    residual = find_residual(target_cells(hollow))
    assert residual is not None
    plates = [region for region in straight_parts(working_grid(residual)) if region.source == "plate"]
    x, _, _ = cells()
    left = (hollow < 0) & (x < -0.7 + wall)
    assert len(plates) == 6
    assert max(share(paint(plate), left) for plate in plates) > 0.6


def test_frame_comes_apart_as_beams() -> None:
    legs = [box((x, y, -0.6), (x + 0.12, y + 0.12, 0.5)) for x in (-0.6, 0.4) for y in (-0.5, 0.3)]
    rail = box((-0.5, -0.48, 0.0), (0.5, -0.4, 0.08))
    residual = find_residual(target_cells(grid(*legs, rail)))
    assert residual is not None
    beams = [paint(part) for part in straight_parts(working_grid(residual)) if part.source == "beam"]
    for leg in legs:
        assert max(share(beam, leg < 0) for beam in beams) > 0.8


def test_run_lengths_count_unbroken_cells() -> None:
    line = np.array([1, 1, 0, 1, 1, 1, 0, 0, 1], bool)
    for axis in range(3):
        shape = np.ones(3, int)
        shape[axis] = len(line)
        lengths = cells_of(line.reshape(shape)).run_lengths()
        assert lengths[axis].tolist() == [2, 2, 3, 3, 3, 1]
        assert (lengths[axis - 1] == 1).all() and (lengths[axis - 2] == 1).all()


@pytest.mark.parametrize("full", [False, True])
def test_components_are_what_labelling_the_grid_finds(rng: np.random.Generator, full: bool) -> None:
    mask = rng.random((14, 9, 11)) < 0.35
    halves = np.broadcast_to(np.arange(14)[:, None, None] >= 6, mask.shape)
    solid_cells = cells_of(mask)
    key = halves[mask].astype(np.int32)
    neighbours = np.ones((3, 3, 3), bool) if full else None
    for half in (0, 1):
        labels, count = ndimage.label(mask & (halves == half), neighbours)
        places = np.flatnonzero(key == half).astype(np.int32)
        parts, found = components(solid_cells, places, key, full)
        assert found == count
        assert (parts + 1 == labels[mask][places]).all()
    largest = largest_components(solid_cells, solid_cells.all_places(), 0 * key, 2, 3, full)
    volumes = np.bincount(ndimage.label(mask, neighbours)[0].ravel())[1:]
    assert [len(part) for part in largest] == [size for size in sorted(volumes)[:-4:-1] if size > 1]


def test_crop_and_neighbours_of_listed_cells(rng: np.random.Generator) -> None:
    mask = rng.random((6, 7, 5)) < 0.4
    solid_cells = cells_of(mask)
    lower, cropped = solid_cells.crop(solid_cells.all_places()[3:9])
    assert (np.argwhere(cropped) + lower == np.argwhere(mask)[3:9]).all()
    for axis, step in ((0, 3), (1, -2), (2, 1)):
        other = solid_cells.beside(axis, step)
        there = np.argwhere(mask)
        there[:, axis] += step
        wanted = [tuple(cell) in {tuple(c) for c in np.argwhere(mask)} for cell in there.tolist()]
        assert (other >= 0).tolist() == wanted
        assert (solid_cells.index.T[other[other >= 0]] == there[other >= 0]).all()


def test_distances_are_the_same_pair_by_pair_and_by_transform(
    rng: np.random.Generator, device: wp.Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    some, others = rng.integers(0, 40, (3, 70)), rng.integers(0, 40, (3, 30))
    wanted = ((some[:, :, None] - others[:, None, :]) ** 2).sum(axis=0).min(axis=1)
    assert (squared_distances(some, others, device) == wanted).all()
    solid = dumbbell()
    pairwise = peeled(solid, 0.03, device)
    monkeypatch.setattr(msd, "PAIRS_PER_CELL", 0)
    monkeypatch.setattr(msd, "PAIRS_PER_TRANSFORM", 0)
    assert np.array_equal(pairwise, peeled(solid, 0.03, device))
