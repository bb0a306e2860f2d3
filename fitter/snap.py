"""Regularity that editors want, as far as the objective allows: symmetry, canonical shapes, axes, sizes, centres.

The target says what is symmetric; the rest follows from the parts. Each relation is tried, and kept if the objective
falls by no more than `draft.FALL`; all together may cost `draft.WHOLE_FALL`. In between all parts are refined
together and made regular again. The order of the primitives stays; parts that symmetry adds come last.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import warp as wp

from ..target.target import Target
from .canonical import canonical_changes
from .config import FitConfig
from .draft import Change, Draft
from .judge import Judge
from .refine import refine
from .relations import Relation
from .snap_axes import snap_axes
from .snap_lengths import snap_centres, snap_sizes
from .symmetric_layout import Layout, add_missing, lay_out, motions_of
from .symmetry import Symmetry, find_symmetries
from .ties import Copied, Ties

SYMMETRY_FALL = 5e-3
"""Most that the objective may fall for symmetry, which is many relations at once."""

REFINE_STEPS = 10
"""Levenberg steps of a refinement between making things regular."""

REFINEMENTS = 3


def snap(
    rows: np.ndarray,
    target: Target,
    config: FitConfig,
    device: wp.Device,
    copies: Sequence[Copied] = (),
    should_stop: Callable[[], bool] = lambda: False,
) -> tuple[np.ndarray, list[Relation]]:
    """Make an assembly regular.

    Args:
        rows: (primitive_count, ROW), the assembly in the target's frame.
        target: what it was fitted to.
        config: of the fit.
        device: where to compute.
        copies: primitives that follow from others already.
        should_stop: asked between stages; once True, what was reached is returned.

    Returns:
        Rows (primitive_count or more, ROW) float32, and the relations that hold in them.
    """
    if not len(rows):
        return rows, []
    judge = Judge(target, config, device)
    draft = Draft(rows, judge, Ties(tuple(copies)))
    stages: list[Callable[[Draft], None]] = [
        lambda draft: _symmetries(draft, find_symmetries(target), config),
        lambda draft: _refine(draft, config, device),
        _canonical,
        snap_axes,
        snap_sizes,
        snap_centres,
        lambda draft: _refine(draft, config, device),
        # Turned boxes that now stand straight, and what refinement brought nearer.
        _canonical,
        snap_sizes,
        snap_centres,
        lambda draft: _refine(draft, config, device),
    ]
    for stage in stages:
        if should_stop():
            break
        stage(draft)
    return draft.rows, _sorted(draft.relations)


def _symmetries(draft: Draft, found: list[Symmetry], config: FitConfig) -> None:
    """Tie the parts by as much of the target's symmetry as the objective allows."""
    planes = [entry for entry in found if entry.order == 1]
    spins = [entry for entry in found if entry.order > 2][:1]
    across = _orthogonal(planes)
    choices = [across + spins, across, spins, *([plane] for plane in across)]
    fixed = {index for copy in draft.ties.copies for index in (copy.source, copy.index)}
    best: tuple[float, Layout, list[Symmetry]] | None = None
    for choice in choices:
        motions = motions_of(choice)
        if not motions or (best is not None and len(choice) < len(best[2])):
            continue
        layout = _completed(lay_out(draft.rows, motions, draft.judge, fixed), draft, config.max_primitives)
        objective = draft.judge.objective(layout.rows)
        tied = bool(layout.ties.copies or layout.ties.astride)
        if tied and objective >= draft.objective - SYMMETRY_FALL and (best is None or objective > best[0]):
            best = (objective, layout, choice)
    if best is None:
        return
    _, layout, choice = best
    ties = layout.ties
    parts = {copy.index for copy in ties.copies} | {copy.source for copy in ties.copies} | set(ties.astride)
    relations = [Relation("symmetry", tuple(sorted(parts)), entry.describe()) for entry in choice]
    draft.restart(layout.rows, Ties((*draft.ties.copies, *ties.copies), ties.astride), relations)


def _orthogonal(planes: list[Symmetry]) -> list[Symmetry]:
    """Planes at right angles to each other, the most exact first."""
    chosen: list[Symmetry] = []
    for plane in planes:
        if all(abs(plane.axis @ other.axis) < 1e-3 for other in chosen):
            chosen.append(plane)
    return chosen


def _completed(layout: Layout, draft: Draft, most: int) -> Layout:
    """The layout with the missing partners that pay for themselves, or nearly."""
    judge = draft.judge
    objective = judge.objective(layout.rows)
    for _ in range(len(layout.alone)):
        better = None
        for candidate in add_missing(layout, judge, most):
            found = judge.objective(candidate.rows)
            if found > objective - 1e-3 and (better is None or found > better[0]):
                better = (found, candidate)
        if better is None:
            break
        objective, layout = better
    return layout


def _canonical(draft: Draft) -> None:
    """Canonical parameters, part by part."""
    for index in draft.free():
        made: dict[str, float] = {}
        tried: set[str] = set()
        while True:
            changes = canonical_changes(draft.rows[index], draft.families[index])
            fresh = [entry for entry in changes if entry[0] not in tried]
            if not fresh:
                break
            parameter, value, _ = fresh[0]
            tried.add(parameter)
            if draft.attempt(_one_change(index, draft.families[index], parameter), None, CANONICAL_FALL):
                made[parameter] = value
        if made:
            parts = tuple(draft.ties.followers(index))
            draft.relations.append(Relation("canonical", parts, made))


CANONICAL_FALL = 5e-4
"""Most that the objective may fall for one parameter of one part."""


def _one_change(index: int, name: str, parameter: str) -> Change:
    """Make one parameter of one part canonical, whatever it is then."""

    def change(rows: np.ndarray) -> np.ndarray:
        for found, _, row in canonical_changes(rows[index], name):
            if found == parameter:
                rows[index] = row
        return rows

    return change


def _refine(draft: Draft, config: FitConfig, device: wp.Device) -> None:
    """Move all parts together and make them regular again, while that raises the objective."""
    steps = replace(config.refine, iterations=REFINE_STEPS, betas=(80.0, 200.0))
    for _ in range(REFINEMENTS):
        moved = refine(draft.rows, draft.families, draft.judge.samples, steps, device)
        if not draft.adopt(moved):
            break


def _sorted(relations: list[Relation]) -> list[Relation]:
    """Symmetry first, then by kind and parts; what was said twice of the same parts is one."""
    merged: dict[tuple, Relation] = {}
    for relation in relations:
        key = (relation.kind, relation.parts, relation.kind not in ("canonical",) and str(relation.value))
        if key in merged and relation.kind == "canonical":
            relation = replace(relation, value={**merged[key].value, **relation.value})
        merged[key] = relation
    order = ("symmetry", "copy", "canonical", "axis", "size", "centre")
    return sorted(merged.values(), key=lambda relation: (order.index(relation.kind), relation.parts))
