"""The state of a search: the assembly of the moment, the best so far, and what is remembered between rounds."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...decomposition.region import Region
from ..objective.cached import DistanceCache
from ..objective.objective import Score, at_price
from ..outcome import Round
from ..propose.candidate_pool import CandidatePool


class Incumbent(NamedTuple):
    """The best assembly so far: rows (primitive_count, ROW), the objective at the full price, and the IoU."""

    rows: np.ndarray
    score: Score
    iou: float


@dataclass
class SearchState:
    """Mutable state of the search: what changes from round to round in one track."""

    rows: np.ndarray
    """(primitive_count, ROW) float32, the assembly of the moment."""
    score: Score
    """Its objective at the price `alpha`."""
    alpha: float
    """Price of a primitive in this round."""
    price: float
    """The full price, to which `alpha` rises."""
    best: Incumbent
    candidate_pool: CandidatePool
    distances: DistanceCache
    """Distances at the samples, of the primitives seen last."""
    slabs: bool
    """Whether slabs are proposed. The first of several tracks does without them: where big perforated pieces are on
    offer, a greedy choice takes them and never gets to what they are made of."""
    rounds: list[Round] = field(default_factory=list)
    timings: dict[str, float] = field(default_factory=dict)
    """Wall seconds by stage."""
    iou: float = 0.0
    grid_field: np.ndarray | None = None
    """The assembly's distances on the target's grid: their residual is decomposed next. None before the first round."""
    beginning: list[Region] | None = None
    """Parts of the whole target, slabs included, where two tracks begin with them."""

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Add the wall time of a block to its stage."""
        begin = time.perf_counter()
        try:
            yield
        finally:
            self.timings[stage] = self.timings.get(stage, 0.0) + time.perf_counter() - begin

    def full_score(self) -> Score:
        """The objective at the full price."""
        return at_price(self.score, self.price, self.alpha)

    def take(self, other: Incumbent) -> None:
        """Go on from another assembly, whose field is not known yet."""
        self.rows, self.score, self.iou = other

    def remember_best(self) -> None:
        """Keep the assembly if it beats the best at the full price."""
        score = self.full_score()
        if score.objective > self.best.score.objective:
            self.best = Incumbent(self.rows, score, self.iou)

    def lower_price(self, share: float) -> None:
        """Go on with primitives at a share of their full price."""
        before, self.price = self.price, share * self.price
        self.score = at_price(self.score, self.price, before)
        self.best = self.best._replace(score=at_price(self.best.score, self.price, before))
