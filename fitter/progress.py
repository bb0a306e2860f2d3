"""Progress reports of a running fit. Imports nothing of the fitter, so that it can be told from the start."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

TARGET_SHARE = 0.1
"""Of the work, as progress bars count it: what loading and measuring the mesh takes."""


@dataclass(frozen=True)
class Progress:
    """Progress report of a fit, for whoever shows it."""

    stage: str
    round: int
    rounds: int
    primitive_count: int
    objective: float
    iou: float
    fraction: float
    """Rough share of the work done, 0 to 1."""
    rows: np.ndarray | None = None
    """The set of the moment, (primitive_count, ROW) float32, normalised frame; a copy. None where there is none."""

    def after_target(self) -> Progress:
        """Progress of the rounds as a share of the whole fit."""
        return replace(self, fraction=TARGET_SHARE + (1.0 - TARGET_SHARE) * self.fraction)
