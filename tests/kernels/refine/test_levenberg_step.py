"""Steps of a refinement on the device against plain NumPy: owners, rows of the loss, their sorting, damped solves."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import random_rows

from resfit.fitter.objective.objective import ObjectiveSamples
from resfit.fitter.presets import RefineConfig
from resfit.fitter.refine.joint import RefineStep, refine, sharpness_levels
from resfit.fitter.refine.levenberg import fit_ranges
from resfit.kernels.field.evaluate import evaluate_primitives
from resfit.kernels.field.hilbert import curve_codes, hilbert_codes
from resfit.kernels.field.points import BLOCK
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.refine.block_solve import RESIDUAL, SYSTEM, UNKNOWNS
from resfit.kernels.refine.levenberg_step import advance, rows_of, step_state
from resfit.kernels.refine.nearest_primitives import find_owners
from resfit.kernels.refine.normal_equations import normal_equations
from resfit.kernels.refine.point_batches import OWNER_BLOCK, point_batches
from resfit.kernels.refine.residual_points import MOVE
from resfit.kernels.rows import BLEND, GATE, ROTATION, SHAPE, SHAPES, TANGENT
from resfit.kernels.runtime import launch as launching

MIXED = ["superfrustum", "superfrustum", "cuboid", "superprimitive", "superfrustum", "superquadric"]
MASK = 0.1
LIMITS = [0.15] * 3 + [0.4] * 3 + [0.25] * SHAPE + [0.02]


def samples_of(rows, families, rng, device, count=3000):
    """Random points whose target is the same assembly, moved a little."""
    points = rng.uniform(-1, 1, (count, 3)).astype(np.float32)
    other = rows.copy()
    other[:, :3] += 0.03 * rng.normal(size=(len(rows), 3))
    distance = evaluate_primitives(PrimitiveSet(other, families, device), points).min(0)
    return ObjectiveSamples(points, distance, rng.uniform(0.5, 2.0, count).astype(np.float32), count // 2)


def owners_of(table, blends):
    """Union, owner, second, their distances and the owner's share, from distances (primitive_count, n)."""
    order = np.argsort(table, axis=0, kind="stable")
    union = table[0].astype(np.float64)
    for value, blend in zip(table[1:], blends[1:], strict=True):
        near = np.maximum(blend - np.abs(union - value), 0)
        union = np.minimum(union, value) - near**2 / (4 * max(blend, 1e-9))
    sorted_table = np.sort(table, axis=0)
    if len(table) == 1:
        return union, order[0], order[0] * 0, sorted_table[0], np.full(len(union), 1e30), np.ones(len(union))
    gap = sorted_table[1] - sorted_table[0]
    blend = np.maximum(blends[np.maximum(order[0], order[1])], 1e-9)
    share = np.clip(0.5 + 0.5 * gap / blend, 0, 1)
    return union, order[0], order[1], sorted_table[0], sorted_table[1], share


def loss_of(rows, families, samples, beta, overlap, device):
    """Systems and loss by NumPy's sorting: the definition."""
    table = evaluate_primitives(PrimitiveSet(rows, families, device), samples.points)
    union, owner, second, nearest, runner_up, share = owners_of(table, rows[:, BLEND])

    def soft_occupancy(distance):
        return 1 / (1 + np.exp(np.clip(beta * np.asarray(distance, np.float64), -40, 40)))

    active = np.flatnonzero((union < MASK) | (samples.distance < MASK))
    blended = active[share[active] < 0.98]
    covered = active[runner_up[active] < 0.5 / beta]
    index = np.concatenate([active, blended, covered])
    own = len(active) + len(blended)
    offset = np.zeros(len(index))
    offset[:own] = union[index[:own]] - np.concatenate([nearest[active], runner_up[blended]])
    slope = np.concatenate([share[active], 1 - share[blended], np.ones(len(covered))])
    target = np.where(np.arange(len(index)) < own, samples.distance[index], 1e30)
    # The later of the two has the blend: its row says how the union falls as the blend widens.
    widening = np.zeros(len(index))
    widening[: len(active)] = -(share * (1 - share) * (owner > second))[active]
    widening[len(active) : own] = -(share * (1 - share) * (second > owner))[blended]
    weight = np.sqrt(samples.weight[index]) * np.where(np.arange(len(index)) < own, 1, np.sqrt(overlap))
    primitive = np.concatenate([owner[active], second[blended], second[covered]])
    points = point_batches(
        samples.points[index], primitive, len(rows), target, weight, offset, slope, widening, device
    )
    error = soft_occupancy(union[active]) - soft_occupancy(samples.distance[active])
    loss = (samples.weight[active] * error**2).sum()
    loss += overlap * (samples.weight[covered] * soft_occupancy(runner_up[covered]) ** 2).sum()
    return normal_equations(PrimitiveSet(rows, families, device), points, beta), loss


def solved(systems, rows, damping, families, most_blend):
    """Rows after one damped step, in float64."""
    ranges = fit_ranges(families)
    out = rows.astype(np.float64)
    for k, system in enumerate(systems.astype(np.float64)):
        slope, shape = system[:UNKNOWNS, RESIDUAL].copy(), rows[k, SHAPES : SHAPES + SHAPE]
        held = np.zeros(UNKNOWNS, bool)
        held[6:TANGENT] = ranges.high[k] <= ranges.low[k]
        held[6:TANGENT] |= (shape <= ranges.low[k]) & (slope[6:TANGENT] > 0)
        held[6:TANGENT] |= (shape >= ranges.high[k]) & (slope[6:TANGENT] < 0)
        held[TANGENT] = not 0 < rows[k, BLEND] <= most_blend
        matrix = system[:UNKNOWNS, :UNKNOWNS] * np.outer(~held, ~held)
        diagonal = np.diag(matrix).copy()
        scale = diagonal.mean() + 1e-12
        diagonal += damping * diagonal + (1e-4 * damping + 1e-7) * scale + held * scale
        np.fill_diagonal(matrix, diagonal)
        step = -np.linalg.solve(matrix, slope * ~held)
        step = np.clip(step, *[side * np.array(LIMITS) for side in (-1, 1)])
        w, v = rows[k, ROTATION].astype(float), rows[k, ROTATION + 1 : ROTATION + 4].astype(float)
        out[k, :3] += step[:3] + 2 * np.cross(v, np.cross(v, step[:3]) + w * step[:3])
        half = step[3:6] / 2
        turned = np.concatenate([[w - v @ half], v + w * half + np.cross(v, half)])
        out[k, ROTATION : ROTATION + 4] = turned / np.linalg.norm(turned)
        out[k, SHAPES : SHAPES + SHAPE] = np.clip(shape + step[6:TANGENT], ranges.low[k], ranges.high[k])
        if not held[TANGENT]:
            out[k, BLEND] = np.clip(rows[k, BLEND] + step[TANGENT], 0, most_blend)
    return out


@pytest.fixture
def scene(device, rng):
    rows = random_rows(rng, MIXED)
    rows[:, :3] *= 0.5
    return rows, samples_of(rows, MIXED, rng, device)


def stepped(rows, families, samples, device, beta, overlap=0.2):
    step = RefineStep(rows, families, samples, RefineConfig(overlap=overlap), device)
    step.sharpen(beta)
    return step


@pytest.mark.parametrize("count", [1, 2, 6, 40])
def test_owners(count, device, rng):
    """Union, owner, runner-up and share agree with NumPy wherever a second primitive blends or covers."""
    families = (MIXED * 7)[:count]
    rows = random_rows(rng, families)
    samples = samples_of(rows, families, rng, device)
    beta = 40.0
    step = stepped(rows, families, samples, device, beta)
    step.owners.live.fill_(1)
    step.trial.set_rows(rows)
    step.list_candidates()
    find_owners(step.trial, step.points.blocks, step.owners)
    found = step.owners
    size = len(samples.points)
    points = np.stack([getattr(step.points.blocks, axis).numpy()[:size] for axis in "xyz"], 1)
    table = evaluate_primitives(PrimitiveSet(rows, families, device), points)
    union, owner, second, nearest, runner_up, share = owners_of(table, rows[:, BLEND])
    np.testing.assert_allclose(found.field.numpy()[:size], union, atol=1e-5)
    np.testing.assert_array_equal(found.owner.numpy()[:size], owner)
    np.testing.assert_array_equal(found.nearest.numpy()[:size], nearest)
    np.testing.assert_allclose(found.share.numpy()[:size], share, atol=1e-4)
    matters = (runner_up < 0.5 / beta) | (share < 0.98)
    assert matters.any() or count == 1
    np.testing.assert_array_equal(found.second.numpy()[:size][matters], second[matters])
    np.testing.assert_array_equal(found.runner_up.numpy()[:size][matters], runner_up[matters])
    assert (found.runner_up.numpy()[:size] >= runner_up).all()
    assert found.counts.numpy().mean() < count or count < 40, "some blocks see fewer primitives"


def test_what_is_dropped_from_the_lists_does_not_matter(device, rng):
    """Primitives that move by less than MOVE own the same points by the shortened lists as by new ones."""
    families = (MIXED * 7)[:40]
    rows = random_rows(rng, families)
    samples = samples_of(rows, families, rng, device)
    step = stepped(rows, families, samples, device, 40.0)
    live = np.repeat(step.owners.live.numpy() > 0, BLOCK)
    shortened = step.owners.ids.numpy()
    assert (shortened < 0).any()
    moved = rows.copy()
    turn = rng.normal(size=(len(rows), 3))
    moved[:, :3] += (0.9 * MOVE * turn / np.linalg.norm(turn, axis=1, keepdims=True)).astype(np.float32)
    step.trial.set_rows(moved)
    found = []
    for prepare in (lambda: None, step.list_candidates):
        prepare()
        find_owners(step.trial, step.points.blocks, step.owners)
        found.append([values.numpy()[live] for values in (step.owners.field, step.owners.owner)])
    near = found[1][0] < 0.1
    np.testing.assert_allclose(found[0][0][near], found[1][0][near], atol=2e-4)
    np.testing.assert_array_equal(found[0][1][near], found[1][1][near])


@pytest.mark.parametrize("beta", [30.0, 120.0])
def test_systems_and_loss_of_a_step(beta, scene, device):
    """What the device sums up is what NumPy's rows give, with blends, covered points and mixed families."""
    rows, samples = scene
    step = stepped(rows, MIXED, samples, device, beta)
    expected, loss = loss_of(rows, MIXED, samples, beta, 0.2, device)
    upper = np.triu(step.state.systems.numpy().reshape(-1, SYSTEM, SYSTEM))
    found = upper + np.triu(upper, 1).transpose(0, 2, 1)
    for k in range(len(rows)):
        # Rows without a slope are left out, and with them constant errors in the corner.
        size = np.abs(expected[k, :UNKNOWNS]).max()
        np.testing.assert_allclose(found[k, :UNKNOWNS], expected[k, :UNKNOWNS], atol=2e-3 * size)
    live = step.owners.live.numpy()
    assert 0 < (live > 0).sum() <= len(live)
    assert float(step.state.loss.numpy()[0]) == pytest.approx(loss, rel=0.02)


def test_gradient_of_a_blend(device, rng):
    """The blend's slope is that of the loss, by finite differences on two primitives that blend widely."""
    families = ["superfrustum"] * 2
    rows = random_rows(rng, families)
    rows[:, :3] = [[-0.2, 0.0, 0.0], [0.2, 0.05, 0.0]]
    rows[:, SHAPES : SHAPES + SHAPE] = [0.5, 0.5, 0.6, 0.3, 0.02, 1.0, 0.0, -1.0]
    rows[:, BLEND] = 0.1
    samples, beta, change = samples_of(rows, families, rng, device, 20_000), 80.0, 1e-3
    found = stepped(rows, families, samples, device, beta, overlap=0.0).state.systems.numpy()
    losses = []
    for side in (-1, 1):
        moved = rows.copy()
        moved[1, BLEND] += side * change
        losses.append(loss_of(moved, families, samples, beta, 0.0, device)[1])
    slope = found.reshape(-1, SYSTEM, SYSTEM)[:, TANGENT, RESIDUAL]
    assert abs(slope[1]) > 1e-2 and slope[0] == 0.0
    assert 2 * slope[1] == pytest.approx((losses[1] - losses[0]) / (2 * change), rel=0.03)


def test_sorting(scene, device):
    """Each primitive's blocks hold its rows in the order of the points, then padding of weight 0."""
    rows, samples = scene
    step = stepped(rows, MIXED, samples, device, 60.0)
    sorter, kind = step.sorter, step.found.kind.numpy()
    live = np.repeat(step.owners.live.numpy() > 0, len(kind) // step.points.blocks.block_count)
    first, weight, x = (
        array.numpy() for array in (sorter.rows.first_block, sorter.rows.weight, sorter.rows.x)
    )
    given = step.points.blocks.x.numpy()
    used = [step.owners.owner.numpy(), step.owners.second.numpy(), step.owners.second.numpy()]
    for k in range(len(rows)):
        mine = [
            i for i in np.flatnonzero(live) for bit in range(3) if kind[i] >> bit & 1 and used[bit][i] == k
        ]
        begin, end = first[k] * OWNER_BLOCK, first[k + 1] * OWNER_BLOCK
        assert end - begin == -(-len(mine) // OWNER_BLOCK) * OWNER_BLOCK
        np.testing.assert_array_equal(x[begin : begin + len(mine)], given[mine])
        assert (weight[begin : begin + len(mine)] > 0).all()
        assert not weight[begin + len(mine) : end].any()
    owners = sorter.rows.owners.numpy()
    np.testing.assert_array_equal(owners[: first[-1]], np.repeat(np.arange(len(rows)), np.diff(first)))
    assert (owners[first[-1] :] == -1).all()


def test_damped_steps(device, rng):
    """Solves, limits, turns and bounds agree with NumPy in float64; what is not kept stays."""
    families = MIXED
    rows = random_rows(rng, families)
    ranges = fit_ranges(families)
    shapes = rows[:, SHAPES : SHAPES + SHAPE]
    shapes[:] = np.clip(shapes, ranges.low, ranges.high)
    shapes[0, 3], shapes[1, 7] = ranges.high[0, 3], ranges.low[1, 7]
    jacobian = rng.normal(size=(len(rows), 60, SYSTEM)) * 10.0 ** rng.uniform(-2, 1, (len(rows), 1, SYSTEM))
    jacobian[:, :, 2] = jacobian[:, :, 3] * 1.001
    systems = np.einsum("kni,knj->kij", jacobian, jacobian).astype(np.float32)
    rows[2, BLEND] = 0.0
    state = step_state(rows, ranges.low, ranges.high, device)
    trial = PrimitiveSet(rows, families, device)
    state.trial_systems.assign(systems.ravel())
    state.kept.fill_(1)
    advance(state, trial, most_blend=0.12)
    np.testing.assert_array_equal(rows_of(state), rows)
    expected = solved(systems, rows, 1e-2, families, 0.12)
    np.testing.assert_allclose(trial.rows_numpy(), expected, atol=2e-5)
    assert (expected[:, BLEND] != rows[:, BLEND]).sum() == len(rows) - 1, "a plain joint stays one"
    np.testing.assert_array_equal(trial.rows_numpy()[:, GATE], rows[:, GATE])
    state.kept.fill_(0)
    state.trial_systems.fill_(7.0)
    state.damping.fill_(10.0)
    advance(state, trial)
    np.testing.assert_array_equal(rows_of(state), rows)
    np.testing.assert_allclose(trial.rows_numpy(), solved(systems, rows, 10.0, families, 0.0), atol=2e-5)
    np.testing.assert_array_equal(trial.rows_numpy()[:, BLEND], rows[:, BLEND])


def test_refinement_lowers_the_loss(scene, device):
    rows, samples = scene
    config = RefineConfig(iterations=12, betas=(60.0, 60.0))
    refined = refine(rows, MIXED, samples, config, device)
    before, after = (
        loss_of(given, MIXED, samples, 60.0, config.overlap, device)[1] for given in (rows, refined)
    )
    assert after < 0.5 * before
    np.testing.assert_array_equal(refined[:, GATE], rows[:, GATE])
    assert (refined[1:, BLEND] != rows[1:, BLEND]).any() and refined[0, BLEND] == rows[0, BLEND]
    rows[:, BLEND] = 0.0
    assert not refine(rows, MIXED, samples, config, device)[:, BLEND].any(), "hard unions stay hard"
    again = refine(rows, MIXED, samples, config, device, should_stop=lambda: True)
    np.testing.assert_array_equal(again, rows)


@pytest.mark.parametrize("iterations", [1, 2, 5, 24, 60])
@pytest.mark.parametrize("betas", [(30.0, 150.0), (80.0, 80.0), (100.0, 110.0)])
def test_sharpness_rises_to_the_last(iterations, betas):
    """A first level at step 0, later ones sharper, the last as asked for, with steps left to use it."""
    levels = sharpness_levels(RefineConfig(iterations=iterations, betas=betas))
    steps = sorted(levels)
    assert steps[0] == 0 and (steps[-1] <= 0.5 * iterations + 1)
    assert [levels[step] for step in steps] == sorted(levels.values())
    if iterations > 5:
        assert levels[0] == betas[0]
    assert levels[steps[-1]] == pytest.approx(betas[1])


def test_same_bytes_on_one_core_and_two(scene, device, rng, monkeypatch):
    rows, _ = scene
    samples = samples_of(rows, MIXED, rng, device, 30_000)
    results = []
    for cores in (1, 2):
        monkeypatch.setattr(launching, "core_count", lambda cores=cores: cores)
        results.append(refine(rows, MIXED, samples, RefineConfig(iterations=6), device).tobytes())
    assert results[0] == results[1]


def test_curve_goes_from_neighbour_to_neighbour():
    codes = hilbert_codes()
    cells = np.empty(len(codes), np.int64)
    cells[codes] = np.arange(len(codes))
    places = np.stack([cells % 32, cells // 32 % 32, cells // 1024], 1)
    assert (np.abs(np.diff(places, axis=0)).sum(1) == 1).all()
    assert len(np.unique(curve_codes(np.random.default_rng(0).uniform(size=(2000, 3))))) > 1500
