"""Regularity that editors want, as far as the objective allows: symmetry, canonical shapes, axes, sizes, centres.

The target says what is symmetric; the rest follows from the parts. Each relation is tried, and kept if the objective
falls by no more than `transaction.FALLS`; all together may cost `transaction.WHOLE_FALL`. In between all parts are
refined together and made regular again. The order of the primitives stays; parts that symmetry adds come last.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import warp as wp

from ...kernels.primitives import family
from ...kernels.primitives.canonical_rules import Rule
from ...shape.target import Target
from ..config import FitConfig
from ..objective.cached import CachedObjective
from ..refine.joint import refine
from .canonical import canonical_changes, shape_of, with_shape
from .constraints import Constraints, Copied
from .relations import Relation
from .snap_axes import snap_axes
from .snap_lengths import snap_centres, snap_sizes
from .symmetric_layout import Layout, copy_across, lay_out, motions_of, resolved, without_idle
from .symmetry import Symmetry, find_symmetries
from .transaction import FALLS, Change, Claim, Transaction

SYMMETRY_FALL = 6e-3
"""Most that the objective may fall for symmetry, which is many relations at once."""

REFINE_STEPS = 10
"""Levenberg steps of a refinement between making things regular."""

REFINEMENTS = 3


@dataclass(frozen=True)
class Regular:
    """A regular assembly."""

    rows: np.ndarray
    """(primitive_count, ROW) float32; symmetry may have added some and taken some out."""
    relations: list[Relation]
    """What holds in them."""
    origin: tuple[int, ...]
    """For each row the primitive that it was, or is an image of."""


def snap(
    rows: np.ndarray,
    target: Target,
    config: FitConfig,
    device: wp.Device,
    copies: Sequence[Copied] = (),
    should_stop: Callable[[], bool] = lambda: False,
) -> Regular:
    """Make an assembly regular.

    Args:
        rows: (primitive_count, ROW), the assembly in the target's frame.
        target: what it was fitted to.
        config: of the fit.
        device: where to compute.
        copies: primitives that follow from others already.
        should_stop: asked between stages; once True, what was reached is returned.
    """
    if not len(rows):
        return Regular(rows, [], ())
    cached_objective = CachedObjective(target, config, device)
    transaction = Transaction(rows, cached_objective, Constraints(tuple(copies)))
    origin = _symmetries(transaction, find_symmetries(target), config, device)
    for fall in FALLS:
        transaction.fall = fall
        for stage in (_canonical, snap_axes, _canonical, snap_sizes, snap_centres):
            if should_stop():
                return Regular(transaction.rows, transaction.relations(), origin)
            stage(transaction)
        _refine(transaction, config, device)
    return Regular(transaction.rows, transaction.relations(), origin)


def _symmetries(
    transaction: Transaction, found: list[Symmetry], config: FitConfig, device: wp.Device
) -> tuple[int, ...]:
    """Tie the parts by as much of the target's symmetry as the objective allows: the largest group that it does.

    Returns:
        For each of the draft's primitives the one that it was, or is an image of.
    """
    across = _orthogonal([entry for entry in found if entry.order == 1])
    spins = [entry for entry in found if entry.order > 2][:1]
    choices = [across + spins, across, spins, *([plane] for plane in across)]
    seen: list[list[str]] = []
    for choice in choices:
        names = sorted(entry.name for entry in choice)
        if not choice or names in seen or not motions_of(choice):
            continue
        seen.append(names)
        layouts = _layouts(transaction, choice, config.max_primitives)
        trials = [_settled(layout, transaction, config, device) for layout in layouts]
        if not trials:
            continue
        number = int(np.argmax([trial.objective for trial in trials]))
        best = trials[number]
        if best.objective < transaction.objective - SYMMETRY_FALL:
            continue
        parts = {index for copy in best.constraints.copies for index in (copy.index, copy.source)}
        parts |= set(best.constraints.astride)
        claims = [_claim(entry, tuple(sorted(parts)), len(best.rows)) for entry in choice]
        transaction.restart(best.rows, best.constraints, claims)
        return layouts[number].origin
    return tuple(range(len(transaction.rows)))


def _layouts(transaction: Transaction, choice: list[Symmetry], most: int) -> list[Layout]:
    """Parts matched with one another, and for planes each side copied onto the other."""
    fixed = {index for copy in transaction.constraints.copies for index in (copy.source, copy.index)}
    layouts = [
        _completed(
            lay_out(transaction.rows, motions_of(choice), transaction.cached_objective, fixed),
            transaction,
            most,
        )
    ]
    if all(entry.order == 1 for entry in choice) and not fixed:
        for sides in product((1.0, -1.0), repeat=len(choice)):
            layout = copy_across(transaction.rows, choice, sides, transaction.cached_objective, fixed, most)
            if layout is not None:
                layouts.append(without_idle(layout, transaction.cached_objective))
    return [layout for layout in layouts if layout.constraints.copies or layout.constraints.astride]


def _settled(layout: Layout, transaction: Transaction, config: FitConfig, device: wp.Device) -> Transaction:
    """A draft of a layout, refined."""
    constraints = Constraints(
        (*transaction.constraints.copies, *layout.constraints.copies), layout.constraints.astride
    )
    trial = Transaction(layout.rows, transaction.cached_objective, constraints)
    _refine(trial, config, device)
    return trial


def _claim(symmetry: Symmetry, parts: tuple[int, ...], count: int) -> Claim:
    value = {**symmetry.describe(), "complete": len(parts) == count}
    return Claim("symmetry", parts, symmetry.name, lambda rows: value)


def _orthogonal(planes: list[Symmetry]) -> list[Symmetry]:
    """Planes at right angles to each other, the most exact first."""
    chosen: list[Symmetry] = []
    for plane in planes:
        if all(abs(plane.axis @ other.axis) < 1e-3 for other in chosen):
            chosen.append(plane)
    return chosen


def _completed(layout: Layout, transaction: Transaction, most: int) -> Layout:
    """The layout with parts that have no partner given one, or gone, where that costs next to nothing."""
    cached_objective = transaction.cached_objective
    objective = cached_objective.objective(layout.rows)
    while layout.alone:
        # Copies of the mesh's parts are known by their place in the list: then nothing is taken out.
        least = len(layout.rows) if transaction.constraints.copies else 1
        candidates = [entry for entry in resolved(layout, cached_objective, most) if len(entry.rows) >= least]
        scores = [cached_objective.objective(candidate.rows) for candidate in candidates]
        if not scores or max(scores) < objective - FALLS[-1]:
            break
        best = int(np.argmax(scores))
        objective, layout = scores[best], candidates[best]
    return layout


def _canonical(transaction: Transaction) -> None:
    """Canonical parameters, part by part."""
    for index in transaction.free():
        tried: set[str] = set()
        while True:
            name = transaction.families[index]
            changes = canonical_changes(transaction.rows[index], name)
            fresh = next((change for change in changes if change.rule.name not in tried), None)
            if fresh is None:
                break
            rule, value = fresh.rule, fresh.value
            tried.add(rule.name)
            parts = tuple(transaction.constraints.followers(index))
            claim = Claim("canonical", parts, rule.name, _canonical_value(index, name, rule, value))
            transaction.attempt(_one_change(index, name, rule, value), claim)


def _canonical_value(index: int, name: str, rule: Rule, value: float) -> Callable[[np.ndarray], float]:
    """The canonical value, which stays; of a square profile and the like what the rule reads, which may not."""
    return lambda rows: rule.read(family(name), shape_of(rows[index])) if rule.read else value


def _one_change(index: int, name: str, rule: Rule, value: float) -> Change:
    """Make one parameter of one part canonical, however far a refinement has moved it since."""

    def change(rows: np.ndarray) -> np.ndarray:
        for found in canonical_changes(rows[index], name):
            if found.rule is rule and (found.value == value or rule.read):
                rows[index] = found.row
                return rows
        rows[index] = with_shape(rows[index], rule.impose(family(name), shape_of(rows[index]), value))
        return rows

    return change


def _refine(transaction: Transaction, config: FitConfig, device: wp.Device) -> None:
    """Move all parts together and make them regular again, while that raises the objective."""
    steps = replace(config.refine, iterations=REFINE_STEPS, betas=(80.0, 200.0))
    for _ in range(REFINEMENTS):
        moved = refine(
            transaction.rows, transaction.families, transaction.cached_objective.samples, steps, device
        )
        if not transaction.adopt(moved):
            break
