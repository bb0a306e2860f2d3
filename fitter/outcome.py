"""Outcome of a fit: the primitives, why it stopped, and the story of its rounds. Writes no file."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

import numpy as np

from .objective.objective import Score


class Status(enum.Enum):
    """Termination reason of a fit; the value is the sentence for people."""

    SATURATED = "another round no longer raised the objective"
    ROUNDS = "the allowed rounds are done"
    MAX_PRIMITIVES = "the allowed number of primitives is reached"
    TARGET_IOU = "the wanted IoU is reached"
    TOLERANCE = "the wanted surface tolerance is reached"
    MOVED = "the parts were moved to lessen the Chamfer distance"
    TIMEOUT = "the time is up; this is the best so far"
    INTERRUPTED = "interrupted; this is the best so far"

    @property
    def stopped_early(self) -> bool:
        """True if the result is less than what was asked for."""
        return self in (Status.TIMEOUT, Status.INTERRUPTED)


@dataclass(frozen=True)
class Round:
    """One round: what was tried, chosen and kept. Rows are (count, ROW) float32."""

    regions: list[dict[str, object]]
    """One description a region."""
    candidates: np.ndarray
    chosen: np.ndarray
    refined: np.ndarray
    kept: np.ndarray
    score: Score
    accepted: bool


@dataclass
class Outcome:
    """The best primitives found."""

    rows: np.ndarray
    """(primitive_count, ROW) float32."""
    families: list[str]
    score: Score
    iou: float
    """At the 128^3 cell centres of [-1, 1]^3."""
    status: Status
    rounds: list[Round] = field(default_factory=list)
    timings: dict[str, float] = field(default_factory=dict)
    """Wall seconds by stage."""
