"""An assembly that is being made regular: changes are tried, and stay if the objective hardly falls."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .judge import Judge
from .relations import Relation
from .ties import Ties

FALL = 1e-3
"""Most that the objective may fall for one relation."""

WHOLE_FALL = 1e-2
"""Most that it may fall for all of them together."""

Change = Callable[[np.ndarray], np.ndarray]
"""Makes a relation hold: rows (k, ROW) to rows; does nothing where it holds."""


class Draft:
    """Rows with ties and relations that hold, and what they cost so far.

    Attributes:
        rows: (primitive_count, ROW) float32.
        ties: what follows from what.
        relations: those that hold.
        objective: of the rows.
        floor: the least that it may come to.
    """

    def __init__(self, rows: np.ndarray, judge: Judge, ties: Ties):
        """Begin with rows in which the ties hold."""
        self.judge, self.ties = judge, ties
        self.families = judge.families(rows)
        self.rows = rows
        self.objective = judge.objective(rows)
        self.floor = self.objective - WHOLE_FALL
        self.relations: list[Relation] = []
        self._changes: list[Change] = []

    def free(self) -> list[int]:
        """Indices of the primitives that may be changed."""
        return self.ties.free(len(self.rows))

    def restart(self, rows: np.ndarray, ties: Ties, relations: Sequence[Relation]) -> None:
        """Go on from other rows and ties, before any change was made."""
        self.rows, self.ties, self.relations = rows, ties, list(relations)
        self.families = self.judge.families(rows)
        self.objective = self.judge.objective(rows)

    def attempt(self, change: Change, relation: Relation | None, fall: float = FALL) -> bool:
        """Try a change; it stays, with its relation, if the objective falls by no more than `fall`."""
        rows = self.ties.complete(change(self.rows.copy()), self.families)
        if np.array_equal(rows, self.rows):
            objective = self.objective
        else:
            objective = self.judge.objective(rows)
        if objective < max(self.objective - fall, self.floor):
            return False
        self._changes.append(change)
        # What would undo an earlier relation is none.
        if not np.array_equal(self.replay(rows), rows):
            self._changes.pop()
            return False
        self.rows, self.objective = rows, objective
        if relation is not None:
            self.relations.append(relation)
        return True

    def replay(self, rows: np.ndarray) -> np.ndarray:
        """Rows in which everything holds that holds in the draft, made from rows (primitive_count, ROW)."""
        for change in self._changes:
            rows = self.ties.complete(change(rows.copy()), self.families)
        return self.ties.complete(rows, self.families)

    def adopt(self, rows: np.ndarray) -> bool:
        """Take rows, made regular by `replay`, instead of the draft's, if they are better."""
        regular = self.replay(rows)
        objective = self.judge.objective(regular)
        if objective <= self.objective or not np.array_equal(self.replay(regular), regular):
            return False
        self.rows, self.objective = regular, objective
        return True
