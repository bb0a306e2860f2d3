"""The points that a fit's objective is measured on."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from ...shape.target import Target
from .objective import ObjectiveSamples

GUARD = 0.25
"""Width of the layer around the target's box that guards watch, normalised units."""
GUARD_SEED = 11
HEAVIEST_GUARD = 4.0
"""Thin boxes have far more room around them than in them; a guard there counts no more than this."""

_made: WeakKeyDictionary[Target, ObjectiveSamples] = WeakKeyDictionary()
"""The samples of each target: a fit asks for them at its beginning, for each track, and at its end."""


def objective_samples(target: Target) -> ObjectiveSamples:
    """The target's points near the surface, those of its box, and guards around the box.

    The objective's volume is the box. What sticks out of it would cost nothing there: guards, as dense as the points
    of the box, count it as false volume. Made once a target; not to be changed.
    """
    if target not in _made:
        _made[target] = _make_samples(target)
    return _made[target]


def _make_samples(target: Target) -> ObjectiveSamples:
    near, volume = target.samples.near, target.samples.volume
    lower, upper = target.lower.astype(np.float64), target.upper.astype(np.float64)
    wide_lower, wide_upper = lower - GUARD, upper + GUARD
    count = len(volume.points) // 2
    candidates = np.random.default_rng(GUARD_SEED).uniform(wide_lower, wide_upper, (4 * count, 3))
    outside = ((candidates < lower) | (candidates > upper)).any(1)
    guards = candidates[outside][:count].astype(np.float32)
    box = float(np.maximum(upper - lower, 1e-9).prod())
    density = ((wide_upper - wide_lower).prod() - box) / max(len(guards), 1) / (box / len(volume.points))
    return ObjectiveSamples(
        np.concatenate([near.points, volume.points, guards]).astype(np.float32),
        np.concatenate([near.distance, volume.distance, target.query.signed_distance(guards)]).astype(
            np.float32
        ),
        np.concatenate(
            [near.weight, np.ones(len(volume.points)), np.full(len(guards), min(density, HEAVIEST_GUARD))]
        ).astype(np.float32),
        len(near.points),
    )
