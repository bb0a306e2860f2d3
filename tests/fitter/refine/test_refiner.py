"""Refiners: both move an assembly to the target, and only one of them drops primitives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import trimesh
import warp as wp

from resfit.fitter.config import FitConfig, preset_config
from resfit.fitter.objective.cached import CachedObjective
from resfit.fitter.objective.samples import objective_samples
from resfit.fitter.presets import RefineConfig
from resfit.fitter.refine.refiner import REFINERS
from resfit.kernels.rows import SHAPES, empty_rows
from resfit.shape.target import Target, make_target

NEVER: Callable[[], bool] = lambda: False  # noqa: E731


@pytest.fixture(scope="module")
def target() -> Target:
    return make_target(trimesh.creation.box((1.0, 0.6, 0.4)), wp.get_device("cpu"), 32, 2000)


def start(count: int) -> np.ndarray:
    """Boxes that are too small."""
    rows = empty_rows(count)
    rows[:, SHAPES : SHAPES + 8] = [1.2, 0.7, 0.5, 0.0, 0.0, 1.0, 0.0, -1.0]
    return rows


@pytest.mark.parametrize("name", sorted(REFINERS))
def test_a_refiner_raises_the_objective(name: str, target: Target) -> None:
    device = wp.get_device("cpu")
    config: FitConfig = preset_config("fast", samples=2000, optimizer=name, device="cpu")
    refiner = REFINERS[name](target, objective_samples(target), config, device)
    cached_objective, rows = CachedObjective(target, config, device), start(1)
    refined = refiner.refine(rows, RefineConfig(), 0, NEVER)
    assert cached_objective.objective(refined) > cached_objective.objective(rows) + 0.1
    again = refiner.refine(rows, RefineConfig(), 0, NEVER)
    assert again.tobytes() == refined.tobytes()
    two = refiner.refine(start(2), RefineConfig(), 0, NEVER)
    assert len(two) == 2 or refiner.selects


@pytest.mark.parametrize("name", sorted(REFINERS))
def test_nothing_is_refined_to_nothing(name: str, target: Target) -> None:
    device = wp.get_device("cpu")
    config = preset_config("fast", samples=2000, optimizer=name, device="cpu")
    refiner = REFINERS[name](target, objective_samples(target), config, device)
    assert len(refiner.refine(empty_rows(0), RefineConfig(), 0, NEVER)) == 0
