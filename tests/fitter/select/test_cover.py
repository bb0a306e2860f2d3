"""A choice of candidates: its score as the objective's definition has it, and which member is missed least."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import warp as wp

from resfit.fitter.objective.objective import SEARCH_OVERLAP_PRICE, ObjectiveSamples, Tally
from resfit.fitter.select.cover import Cover
from resfit.kernels.select.coverage_sets import hold

ALPHA = 0.01


@pytest.fixture
def samples(rng: np.random.Generator) -> ObjectiveSamples:
    """600 points, a third of them near the surface and weighted."""
    weight = np.where(np.arange(600) < 200, rng.uniform(1.0, 2.0, 600), 1.0)
    distance = rng.uniform(-1.0, 1.0, 600).astype(np.float32)
    return ObjectiveSamples(np.zeros((600, 3), np.float32), distance, weight.astype(np.float32), 200)


def expected(bits: np.ndarray, samples: ObjectiveSamples, false_volume: float = 1.0) -> float:
    """The objective of chosen candidates (k, n) by its definition."""
    held, near = bits.sum(axis=0), np.arange(bits.shape[1]) < samples.near_count
    total = 0.0
    for part in (near, ~near):
        weight, inside, covered = (a[part] for a in (samples.weight.astype(float), samples.inside, held > 0))
        wrong = false_volume * weight[covered & ~inside].sum()
        total += 0.5 * weight[covered & inside].sum() / (weight[inside].sum() + wrong)
    overlap = (held[~near] > 1).sum() / max((held[~near] > 0).sum(), 1)
    return total - ALPHA * len(bits) - SEARCH_OVERLAP_PRICE * overlap


@pytest.mark.parametrize("false_volume", [1.0, 0.25])
def test_scores_of_all_small_choices(
    false_volume: float, samples: ObjectiveSamples, rng: np.random.Generator, device: wp.Device
) -> None:
    bits = rng.uniform(size=(5, 600)) < 0.4
    cover = Cover(hold(bits, device), Tally(samples), ALPHA, false_volume)
    for count in range(4):
        for chosen in combinations(range(5), count):
            for index in chosen:
                cover.add(index)
            assert cover.score() == pytest.approx(
                expected(bits[list(chosen)], samples, false_volume), abs=1e-9
            )
            for index in chosen:
                cover.remove(index)
    assert cover.chosen == [] and not cover.held.any()


def test_the_best_removal_is_the_best_of_all(
    samples: ObjectiveSamples, rng: np.random.Generator, device: wp.Device
) -> None:
    bits = np.stack([samples.inside & (rng.uniform(size=600) < share) for share in (0.9, 0.5, 0.3)])
    bits = np.concatenate([bits, rng.uniform(size=(1, 600)) < 0.3])
    cover = Cover(hold(bits, device), Tally(samples), ALPHA)
    for index in (2, 0, 3, 1):
        cover.add(index)
    before = cover.score()
    gains = {k: expected(np.delete(bits, k, axis=0), samples) - before for k in range(4)}
    index, gain = cover.best_removal()
    assert index == max(gains, key=gains.__getitem__) == 3
    assert gain == pytest.approx(gains[3], abs=1e-9)
    cover.remove(index)
    assert cover.score() == pytest.approx(before + gain, abs=1e-9)
