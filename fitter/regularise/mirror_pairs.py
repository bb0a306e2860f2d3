"""Mirror pairs: parts of a symmetric target that are nearly each other's image become exactly so.

A search finds the left wheel and the right one by different ways, and they come out a little different. Only what is
there already is made alike, and only where the objective hardly falls; `fitter/regularise/snap.py` goes further.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...shape.target import Target
from ..objective.cached import CachedObjective
from .constraints import Constraints, Copied
from .symmetric_layout import lay_out, motions_of
from .symmetry import find_planes

MOST_FALL = 2e-4
"""Most that the objective may fall for one pair or one part: a thirteenth of a part's price."""

WHOLE_FALL = 1e-3
"""Most that it may fall for all of them."""


@dataclass(frozen=True)
class MirrorPairs:
    """Rows in which pairs are alike."""

    rows: np.ndarray
    """(primitive_count, ROW) float32."""
    copies: tuple[Copied, ...]
    """The parts that are images of others, those given among them."""


def mirror_pairs(
    rows: np.ndarray, target: Target, cached_objective: CachedObjective, copies: Sequence[Copied] = ()
) -> MirrorPairs:
    """Rows whose parts are mirrored across the target's plane of symmetry, as far as that costs nothing.

    Args:
        rows: (primitive_count, ROW).
        target: what they were fitted to; where it has several planes, the most exact one counts.
        cached_objective: of the target.
        copies: primitives that follow from others; they stay so.
    """
    planes = find_planes(target) if len(rows) > 1 else []
    if not planes:
        return MirrorPairs(rows, tuple(copies))
    fixed = {index for copy in copies for index in (copy.source, copy.index)}
    found = lay_out(rows, motions_of(planes[:1]), cached_objective, fixed).constraints
    families, objective, constraints = (
        cached_objective.families(rows),
        cached_objective.objective(rows),
        Constraints(tuple(copies)),
    )
    floor = objective - WHOLE_FALL
    trials = [Constraints(constraints.copies, {index: motions}) for index, motions in found.astride.items()]
    for trial in trials:
        changed = trial.complete(rows, families)
        score = cached_objective.objective(changed)
        if score >= max(floor, objective - MOST_FALL):
            rows, objective = changed, score
    for copy in found.copies:
        # A reflection is its own inverse: either part may be the other's image.
        inverse = Copied(copy.index, copy.source, copy.turn.T, -copy.turn.T @ copy.shift)
        options = []
        for one in (copy, inverse):
            changed = Constraints((*constraints.copies, one)).complete(rows, families)
            options.append((cached_objective.objective(changed), changed, one))
        score, changed, one = max(options, key=lambda option: option[0])
        if score >= max(floor, objective - MOST_FALL):
            rows, objective, constraints = changed, score, Constraints((*constraints.copies, one))
    return MirrorPairs(rows, constraints.copies)
