"""Joint refinement: all primitives follow the union's error together, each by its own damped step.

Points belong to the primitive nearest to them, so the normal matrix is nearly block-diagonal (design: second order
beats Adam). A point that a second primitive covers gives that one a row which pushes it out; where two blend,
both get the union's row. Owners change as primitives move: they are found anew at every step.

A step is a fixed sequence of launches over arrays of fixed size, and nothing in it is read back: on a GPU it is
captured once and replayed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import warp as wp

from ...kernels.field.combine import FAR
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.refine.levenberg_step import Damping, advance, judge_together, rows_of, step_state
from ...kernels.refine.nearest_primitives import find_owners, list_candidates, nearest_primitive_arrays
from ...kernels.refine.normal_equations import normal_equations_at, partial_systems
from ...kernels.refine.prune_lists import prune_lists
from ...kernels.refine.residual_points import MASK as MASK
from ...kernels.refine.residual_points import contributions, drop_blocks, residual_points, weigh_points
from ...kernels.refine.residual_rows import RowSorter
from ...kernels.refine.residuals import residual_weights
from ...kernels.runtime.launch_graph import LaunchGraph
from ..objective.objective import ObjectiveSamples
from ..presets import RefineConfig
from .levenberg import fit_ranges

SHARED_DAMPING = Damping(better=0.7, worse=4.0, least=1e-5)

MOST_BLEND = 0.055
"""Largest blend radius, normalised units. A blend of 0 stays 0."""

RAISE = 2.4
"""The sharpness rises by about this factor at a time: each time starts from a new loss, at all points."""

ANNEALED = 0.3
"""Share of the steps after which it rises no more."""


def refine(
    rows: np.ndarray,
    families: Sequence[str],
    samples: ObjectiveSamples,
    config: RefineConfig,
    device: wp.Device,
    should_stop: Callable[[], bool] = lambda: False,
) -> np.ndarray:
    """Move all primitives so that their smooth union matches the target.

    Args:
        rows: (primitive_count, ROW).
        families: their families.
        samples: target distances at the points of the loss.
        config: steps, sharpness, weights of the loss's terms.
        device: where to evaluate.
        should_stop: asked before each step; True returns the best so far.

    Returns:
        Refined rows (primitive_count, ROW) float32; gates unchanged, and blends where they are 0.
    """
    if not len(rows) or not len(samples.points):
        return rows
    step = RefineStep(rows, families, samples, config, device)
    levels = sharpness_levels(config)
    for number in range(config.iterations):
        if should_stop():
            break
        if number in levels:
            step.sharpen(levels[number])
        step.run()
    return rows_of(step.state)


def sharpness_levels(config: RefineConfig) -> dict[int, float]:
    """The steps at which the sharpness rises, and to what: evenly until ANNEALED, each time by about RAISE."""
    low, high = config.betas
    count = max(1, round(np.log(high / low) / np.log(RAISE))) if high > low else 0
    until = ANNEALED * config.iterations
    # Steps that coincide, in a short refinement, keep the sharper one.
    return {
        round(n * until / max(count, 1)): low * (high / low) ** (n / max(count, 1)) for n in range(count + 1)
    }


class RefineStep:
    """The arrays of a refinement, and one step on them: evaluate the trial, judge it, make the next."""

    def __init__(
        self,
        rows: np.ndarray,
        families: Sequence[str],
        samples: ObjectiveSamples,
        config: RefineConfig,
        device: wp.Device,
    ):
        self.device, self.weights, count = device, residual_weights(config), len(rows)
        self.points = residual_points(samples.points, samples.distance, samples.weight, device)
        self.trial = PrimitiveSet(rows, families, device)
        ranges = fit_ranges(families)
        self.state = step_state(rows, ranges.low, ranges.high, device)
        self.betas = wp.zeros(count, dtype=float, device=device)
        self.owners = nearest_primitive_arrays(count, self.points.blocks, self.points.bounds)
        self.found = contributions(count, self.points)
        self.sorter = RowSorter(count, self.points, self.owners, self.found, self.weights)
        self.partial = partial_systems(self.sorter.rows, device)
        self.run = LaunchGraph(self.launch, device)

    def sharpen(self, beta: float) -> None:
        """Go on from the best so far with another sharpness, whose loss is not known yet."""
        self.betas.fill_(beta)
        self.state.loss.fill_(float(FAR))
        wp.copy(self.trial.rows, self.state.rows)
        self.trial.derive()
        self.owners.live.fill_(1)
        self.list_candidates()
        find_owners(self.trial, self.points.blocks, self.owners)
        drop_blocks(self.points, self.owners, self.betas)
        prune_lists(self.trial, self.points.blocks, self.betas, self.owners)
        self.judge_and_advance()

    def list_candidates(self) -> None:
        """Show all blocks what can matter there, wherever primitives move until the sharpness rises again."""
        list_candidates(self.trial, self.points.blocks, self.points.bounds, self.betas, self.owners)

    def launch(self) -> None:
        """Evaluate the trial and its systems, keep it if the loss fell, and move on to the next trial; `run` repeats
        it. On a GPU `sharpen` has loaded the kernels before."""
        find_owners(self.trial, self.points.blocks, self.owners)
        self.judge_and_advance()

    def judge_and_advance(self) -> None:
        """The same, once owners are known."""
        count = len(self.trial)
        weigh_points(self.points, self.owners, count, self.betas, self.weights, self.found)
        self.sorter.sort()
        normal_equations_at(
            self.trial,
            self.sorter.rows,
            self.betas,
            self.partial,
            self.state.trial_systems,
            self.sorter.block_count,
        )
        judge_together(self.state, count, self.found.loss, SHARED_DAMPING)
        advance(self.state, self.trial, MOST_BLEND)
