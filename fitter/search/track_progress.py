"""Progress of a search: what its tracks have done, told as one share of the work."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from ..progress import Progress
from .state import SearchState


@dataclass(frozen=True)
class TrackProgress:
    """The progress of one track; the first one tells of all."""

    on_progress: Callable[[Progress], None] | None
    """What is told; None for a track that is silent."""
    rounds: int
    """Allowed in all."""
    track: int = 0
    """Its place among the tracks."""
    positions: list[float] = field(default_factory=lambda: [0.0])
    """Rounds done of each track, which all tracks share."""

    def silent_track(self) -> TrackProgress:
        """The progress of one more track, told by this one."""
        self.positions.append(0.0)
        return replace(self, on_progress=None, track=len(self.positions) - 1)

    def tell(self, state: SearchState, stage: str, number: int, within: float) -> None:
        """Report progress: `number` rounds of the track and the share `within` of its next are done."""
        self.positions[self.track] = number + within
        if self.on_progress is None:
            return
        done = sum(self.positions)
        # Most fits saturate early: the share is that of a fit of half the allowed rounds, approached smoothly.
        share = 1.0 - 0.5 ** (done / max(1.0, 0.3 * self.rounds))
        self.on_progress(
            Progress(
                stage,
                min(int(done) + 1, self.rounds),
                self.rounds,
                len(state.rows),
                state.score.objective,
                state.iou,
                share,
                state.rows.copy(),
            )
        )
