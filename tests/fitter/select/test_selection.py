"""Counting, choosing and pruning on small sets whose best answer is known or can be searched for."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from resfit.fitter.objective.objective import SEARCH_OVERLAP_PRICE, ObjectiveSamples, Tally
from resfit.fitter.presets import SelectConfig
from resfit.fitter.select.greedy_cover import GreedyCover
from resfit.fitter.select.selection import prune, select
from resfit.kernels.field.evaluate import evaluate_primitives
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.rows import ROTATION, SHAPES, empty_rows
from resfit.kernels.runtime import launch as launching
from resfit.kernels.select.containment import PointContainment
from resfit.kernels.select.coverage_sets import hold, masks_of


def line_samples(rng, count=4000):
    """Points on [-1, 1] in the x axis; the target is |x| < 0.8. The first half counts as near the surface."""
    x = np.sort(rng.uniform(-1, 1, count))
    x = np.concatenate([x[::2], x[1::2]])
    points = np.stack([x, np.zeros(count), np.zeros(count)], 1).astype(np.float32)
    weight = np.where(np.arange(count) < count // 2, rng.uniform(1, 2, count), 1.0).astype(np.float32)
    return ObjectiveSamples(points, (np.abs(x) - 0.8).astype(np.float32), weight, count // 2)


def spans(samples, edges):
    """Candidates that hold the points between each pair of edges, (candidates, n) bool."""
    x = samples.points[:, 0]
    return np.stack([(x > low) & (x < high) for low, high in edges])


def exact_objective(bits, samples, alpha):
    """The objective by its definition."""
    counts = bits.sum(0)
    covered, inside, near = counts > 0, samples.inside, np.arange(len(counts)) < samples.near_count
    total = 0.0
    for part in (near, ~near):
        weight = samples.weight[part].astype(np.float64)
        both, either = (covered & inside)[part], (covered | inside)[part]
        total += 0.5 * weight[both].sum() / weight[either].sum()
    overlap = (counts > 1)[~near].sum() / max(1, covered[~near].sum())
    return total - alpha * len(bits) - SEARCH_OVERLAP_PRICE * overlap


def test_common_points_are_counted_exactly(device, rng, monkeypatch):
    """Whatever was appended and forgotten before, candidates share the points that their bits say."""
    bits = rng.uniform(size=(130, 3000)) < rng.uniform(0, 0.6, (130, 1))
    bits[5] = False
    common = bits.astype(int) @ bits.T
    asked = [0, 5, 31, 32, 99]
    for cores in (1, 2):
        monkeypatch.setattr(launching, "core_count", lambda cores=cores: cores)
        coverage = hold(bits[:100], device)
        np.testing.assert_array_equal(coverage.common(asked), common[asked, :100])
        coverage.append(masks_of(~bits))
        assert coverage.common([0])[0, 100] == 0
        coverage.truncate(100)
        coverage.append(masks_of(bits[100:]))
        np.testing.assert_array_equal(coverage.common(asked), common[asked])
        other = hold(bits[:3], device)
        other.append_from(coverage, np.array([129, 40]))
        np.testing.assert_array_equal(other.common([0, 3]), common[np.ix_([0, 129], [0, 1, 2, 129, 40])])
        coverage.drop_first(70)
        np.testing.assert_array_equal(coverage.common([0, 59]), common[[70, 129], 70:])
        np.testing.assert_array_equal(coverage.sizes, bits[70:].sum(1))


def test_points_in_primitives(device, rng):
    """Masks say what the distances say, for small and big primitives, bent ones among them."""
    points = rng.uniform(-1, 1, (1000, 3)).astype(np.float32)
    rows = empty_rows(40)
    rows[:, :3] = rng.uniform(-0.7, 0.7, (40, 3))
    rows[:, ROTATION : ROTATION + 4] = rng.normal(size=(40, 4))
    rows[:, SHAPES : SHAPES + 3] = rng.uniform(0.05, 1.2, (40, 3))
    rows[:, SHAPES + 5] = 1.0
    rows[::2, SHAPES + 6] = rng.uniform(-1, 1, 20)
    primitives = PrimitiveSet(rows, ["superfrustum"] * 40, device)
    masks = PointContainment(points, device).masks(primitives)
    inside = evaluate_primitives(primitives, points) < 0
    assert inside.sum(1).min() < 10 and inside.sum(1).max() > 100
    np.testing.assert_array_equal(masks, masks_of(inside))


def test_gains_stay_those_of_the_definition(device, rng):
    """After any additions and removals, score and gains are what the objective's definition gives."""
    samples = line_samples(rng)
    edges = np.sort(rng.uniform(-1, 1, (25, 2)), axis=1)
    bits, tally, alpha = spans(samples, edges), Tally(samples), 1e-3
    choice = GreedyCover(hold(bits, device), tally, alpha)
    for index in (3, 7, 11, 2, 19):
        choice.add(index)
    choice.remove(11)
    branch = choice.copy()
    branch.add(20)
    assert choice.score() == pytest.approx(exact_objective(bits[choice.chosen], samples, alpha), abs=1e-5)
    assert branch.score() == pytest.approx(exact_objective(bits[branch.chosen], samples, alpha), abs=1e-5)
    gains = choice.gains()
    for index in range(25):
        if index in choice.chosen:
            assert gains[index] == -np.inf
        else:
            after = exact_objective(bits[[*choice.chosen, index]], samples, alpha)
            assert gains[index] == pytest.approx(after - choice.score(), abs=1e-5)
    leaver, gain = choice.best_removal()
    rest = [index for index in choice.chosen if index != leaver]
    assert gain == pytest.approx(exact_objective(bits[rest], samples, alpha) - choice.score(), abs=1e-5)


def test_replacements_are_those_of_the_definition(device, rng):
    """The members that leave for a newcomer are found one by one by the objective's definition, and nothing changes."""
    samples = line_samples(rng)
    edges = np.sort(rng.uniform(-1, 1, (60, 2)), axis=1)
    bits, tally, alpha = spans(samples, edges), Tally(samples), 2e-3
    choice = GreedyCover(hold(bits, device), tally, alpha)
    for index in range(40):
        choice.add(index)
    before, counts = choice.score(), choice.counts.save()[0]
    found = choice.replace_redundant(range(40, 60))
    assert choice.score() == before
    np.testing.assert_array_equal(choice.counts.save()[0], counts)
    for newcomer, leavers in zip(range(40, 60), found, strict=True):
        members, left = list(range(40)), []
        while members:
            with_all = exact_objective(bits[[*members, newcomer]], samples, alpha)
            scores = [
                exact_objective(bits[[*(m for m in members if m != member), newcomer]], samples, alpha)
                for member in members
            ]
            if max(scores) <= with_all:
                break
            left.append(members.pop(int(np.argmax(scores))))
        rose = exact_objective(bits[[*members, newcomer]], samples, alpha) > before + 1e-6
        assert leavers == (left if rose else None)
    assert any(found)


def test_selection_finds_the_best_set(device, rng):
    """On ten candidates the search agrees with trying all sets, within the price of a primitive."""
    samples = line_samples(rng)
    tally, alpha = Tally(samples), 5e-3
    for _ in range(10):
        edges = np.sort(rng.uniform(-1, 1, (10, 2)), axis=1)
        bits = spans(samples, edges)
        chosen = select(hold(bits, device), tally, alpha, SelectConfig())
        found = exact_objective(bits[chosen], samples, alpha) if chosen else 0.0
        best = max(
            exact_objective(bits[list(group)], samples, alpha)
            for size in range(1, 5)
            for group in combinations(range(10), size)
        )
        assert found >= best - alpha


def test_two_halves_give_way_to_the_whole(device, rng):
    """Greedy choice of halves is mended when one candidate does for both."""
    samples = line_samples(rng)
    bits = spans(samples, [(-0.8, 0.0), (0.0, 0.8), (-0.8, 0.8)])
    assert select(hold(bits, device), Tally(samples), 1e-3, SelectConfig(), start=[0, 1]) == [2]


def test_limits(device, rng):
    samples = line_samples(rng)
    bits = spans(samples, [(-0.8, -0.3), (-0.3, 0.3), (0.3, 0.8)])
    tally = Tally(samples)
    assert sorted(select(hold(bits, device), tally, 1e-3, SelectConfig())) == [0, 1, 2]
    assert len(select(hold(bits, device), tally, 1e-3, SelectConfig(), most=2)) == 2
    assert select(hold(bits[:0], device), tally, 1e-3, SelectConfig()) == []
    outside = spans(samples, [(0.85, 1.0)])
    assert select(hold(outside, device), tally, 1e-3, SelectConfig()) == []


def test_prune_drops_what_does_not_pay(device, rng):
    samples = line_samples(rng)
    bits = spans(samples, [(-0.8, 0.8), (-0.1, 0.1), (-0.5, 0.2), (0.79, 0.81)])
    assert prune(hold(bits, device), Tally(samples), 1e-3) == [0]
    assert prune(hold(bits[:1], device), Tally(samples), 1e-3) == [0]
