"""An assembly that is being made regular: changes are tried, and stay if the objective hardly falls."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..objective.cached import CachedObjective
from .constraints import Constraints
from .relations import Relation

FALLS = (2e-4, 1e-3)
"""Most that the objective may fall for one relation, in the first and the second pass: the cheap ones come first."""

WHOLE_FALL = 1e-2
"""Most that it may fall for all of them together."""

PASSES = 4
"""Relations that touch the same numbers may need several passes until all hold."""

ORDER = ("symmetry", "copy", "canonical", "axis", "size", "centre")
"""Of the kinds of relations in a report."""

Change = Callable[[np.ndarray], np.ndarray]
"""Makes a relation hold: rows (k, ROW) to rows; does nothing where it holds."""


@dataclass(frozen=True)
class Claim:
    """A relation whose numbers may still change."""

    kind: str
    """As in `Relation`."""
    parts: tuple[int, ...]
    what: Hashable
    """Tells it from others of its kind among the same parts."""
    value: Callable[[np.ndarray], Any]
    """From rows to the value of the relation."""


class Transaction:
    """Rows with ties and relations that hold, and what they cost so far.

    Attributes:
        rows: (primitive_count, ROW) float32.
        constraints: what follows from what.
        claims: the relations that hold.
        fall: most that the objective may fall for one more.
        objective: of the rows.
        floor: the least that it may come to.
    """

    def __init__(self, rows: np.ndarray, cached_objective: CachedObjective, constraints: Constraints):
        """Begin with rows in which the ties hold."""
        self.cached_objective, self.constraints = cached_objective, constraints
        self.families = cached_objective.families(rows)
        self.rows = rows
        self.objective = cached_objective.objective(rows)
        self.floor = self.objective - WHOLE_FALL
        self.fall = FALLS[0]
        self.claims: list[Claim] = []
        self._changes: list[Change] = []

    def free(self) -> list[int]:
        """Indices of the primitives that may be changed."""
        return self.constraints.free(len(self.rows))

    def restart(self, rows: np.ndarray, constraints: Constraints, claims: Sequence[Claim]) -> None:
        """Go on from other rows and ties, before any change was made."""
        self.rows, self.constraints, self.claims = rows, constraints, list(claims)
        self.families = self.cached_objective.families(rows)
        self.objective = self.cached_objective.objective(rows)

    def attempt(self, change: Change, claim: Claim) -> bool:
        """Try a change; it stays, with its claim, if the objective falls by no more than it may."""
        rows = self.constraints.complete(change(self.rows.copy()), self.families)
        if np.array_equal(rows, self.rows):
            objective = self.objective
        else:
            objective = self.cached_objective.objective(rows)
        if objective < max(self.objective - self.fall, self.floor):
            return False
        self._changes.append(change)
        # What would undo an earlier relation is none.
        if not np.array_equal(self.replay(rows), rows):
            self._changes.pop()
            return False
        self.rows, self.objective = rows, objective
        self.claims.append(claim)
        return True

    def replay(self, rows: np.ndarray) -> np.ndarray:
        """Rows in which everything holds that holds in the draft, as far as one pass gets: equal rows, if it does."""
        rows = rows.copy()
        for change in self._changes:
            rows = change(rows)
        return self.constraints.complete(rows, self.families)

    def adopt(self, rows: np.ndarray) -> bool:
        """Take rows, made regular by `replay`, instead of the draft's, if they are better."""
        before, regular = rows, self.replay(rows)
        for _ in range(PASSES):
            if np.array_equal(before, regular):
                break
            before, regular = regular, self.replay(regular)
        else:
            return False
        objective = self.cached_objective.objective(regular)
        if objective <= self.objective:
            return False
        self.rows, self.objective = regular, objective
        return True

    def relations(self) -> list[Relation]:
        """Relations that hold, each once, symmetry first; canonical parameters of a part together."""
        found: dict[tuple[Any, ...], Relation] = {}
        for claim in self.claims:
            value = claim.value(self.rows)
            # Of the axes of a part the last word counts: one that was lined up first, then all three.
            key = (claim.kind, claim.parts, None if claim.kind in ("canonical", "axis") else claim.what)
            if claim.kind == "canonical":
                value = {**(found[key].value if key in found else {}), str(claim.what): value}
            found[key] = Relation(claim.kind, claim.parts, value)
        return sorted(found.values(), key=lambda relation: (ORDER.index(relation.kind), relation.parts))
