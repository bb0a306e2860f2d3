"""Refiners: the optimisers that move all primitives of an assembly together, one interface for the rounds of a fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
import warp as wp

from ...shape.target import Target
from ..config import FitConfig, RefineConfig
from ..objective.objective import ObjectiveSamples
from ..objective.outside_samples import with_outside_samples
from .adam import refine_with_adam
from .joint import refine


class Refiner(Protocol):
    """An optimiser of all primitives at once, bound to a target and to the options of a fit."""

    selects: ClassVar[bool]
    """Whether it decides by itself which primitives exist. Such a one is given a seed for each region and drops those
    that it does not need; candidates are neither fitted nor selected for it, and a finished assembly is not its job."""

    def refine(
        self, rows: np.ndarray, settings: RefineConfig, seed: int, should_stop: Callable[[], bool]
    ) -> np.ndarray:
        """Refined rows (kept, ROW) float32 of rows (primitive_count, ROW), normalised frame.

        Args:
            rows: the assembly.
            settings: steps and sharpness, where the optimiser has no settings of its own.
            seed: of whatever is drawn at random.
            should_stop: asked before each step; True returns the best so far.
        """
        ...


@dataclass(frozen=True)
class LevenbergRefiner:
    """Levenberg-Marquardt steps, one block a primitive; all primitives stay."""

    target: Target
    samples: ObjectiveSamples
    config: FitConfig
    device: wp.Device
    selects: ClassVar[bool] = False

    def refine(
        self, rows: np.ndarray, settings: RefineConfig, seed: int, should_stop: Callable[[], bool]
    ) -> np.ndarray:
        """As `Refiner`; if the configuration has probes, samples where primitives stick out are added."""
        families, samples = [self.config.primitive] * len(rows), self.samples
        if self.config.probes:
            samples = with_outside_samples(samples, rows, families, self.target, seed, self.device)
        return refine(rows, families, samples, settings, self.device, should_stop)


@dataclass(frozen=True)
class AdamRefiner:
    """The paper's Adam with stochastic existence; its settings are `FitConfig.adam`."""

    target: Target
    samples: ObjectiveSamples
    config: FitConfig
    device: wp.Device
    selects: ClassVar[bool] = True

    def refine(
        self, rows: np.ndarray, settings: RefineConfig, seed: int, should_stop: Callable[[], bool]
    ) -> np.ndarray:
        """As `Refiner`; `settings` are not used."""
        return refine_with_adam(
            rows,
            [self.config.primitive] * len(rows),
            self.samples,
            self.config.adam,
            seed,
            self.device,
            should_stop,
            self.target.query.signed_distance,
        )


REFINERS: dict[str, type[LevenbergRefiner] | type[AdamRefiner]] = {
    "levenberg": LevenbergRefiner,
    "adam": AdamRefiner,
}
"""By the names of the option."""
