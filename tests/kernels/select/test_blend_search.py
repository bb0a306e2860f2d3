"""Blends chosen from many: as if the whole union were folded anew for each."""

from __future__ import annotations

import numpy as np

from resfit.fitter.objective.objective import ObjectiveSamples, Tally
from resfit.fitter.objective.scoring import BLEND_CHOICES, choose_blends
from resfit.kernels.field.combine import fold
from resfit.kernels.rows import BLEND, empty_rows


def joined_balls(rng, count):
    """Samples of a row of balls that are smoothly joined, and the balls' distances at them."""
    points = rng.uniform(-1, 1, (6000, 3)).astype(np.float32) * np.float32([1.0, 0.4, 0.4])
    centres = np.stack([np.linspace(-0.8, 0.8, count), *np.zeros((2, count))], 1)
    values = np.linalg.norm(points - centres[:, None], axis=2) - rng.uniform(0.1, 0.25, (count, 1))
    true_blends = rng.choice(BLEND_CHOICES, count)
    weight = np.where(np.arange(6000) < 3000, rng.uniform(1, 2, 6000), 1.0).astype(np.float32)
    return ObjectiveSamples(
        points, fold(values, true_blends).astype(np.float32), weight, 3000
    ), values.astype(np.float32)


def score_of(values, blends, tally):
    """What a set of blends is worth."""
    union = fold(values.astype(np.float64), blends.astype(np.float64)) < 0
    held = np.where((values >= 0).all(0), 0, 1)
    return tally.score(union, held, 0, 0.0).objective


def test_each_blend_is_the_best_while_the_others_stay(device, rng):
    for count in (1, 2, 9):
        samples, values = joined_balls(rng, count)
        tally, rows = Tally(samples), empty_rows(count)
        rows[:, BLEND] = rng.choice([0.0, 0.01, 0.047], count)
        found = choose_blends(values, rows, tally, device)
        blends = rows[:, BLEND].copy()
        for k in range(1, count):
            choices = np.float32([*BLEND_CHOICES, blends[k]])
            scores = []
            for choice in choices:
                blends[k] = choice
                scores.append(score_of(values, blends, tally) - (1e-5 if choice else 0.0))
            blends[k] = choices[np.argmax(scores)]
        np.testing.assert_array_equal(found[:, BLEND], blends)
        assert count < 9 or len(set(blends)) > 2


def test_no_smooth_joint_where_it_makes_no_difference(device, rng):
    samples, values = joined_balls(rng, 3)
    rows = empty_rows(3)
    rows[:, BLEND] = 0.02
    found = choose_blends(values + 9.0, rows, Tally(samples), device)
    np.testing.assert_array_equal(found[1:, BLEND], 0.0)
