"""Progress of several tracks is one share of the work, told by the first."""

from __future__ import annotations

import trimesh
import warp as wp

from resfit.fitter.config import preset_config
from resfit.fitter.progress import Progress
from resfit.fitter.search.assess import begin_search
from resfit.fitter.search.context import search_context
from resfit.fitter.search.track_progress import TrackProgress
from resfit.shape.target import make_target


def test_a_silent_track_counts(device: wp.Device) -> None:
    target = make_target(trimesh.creation.box((1.0, 0.6, 0.4)), device, 32, 1000)
    state = begin_search(search_context(target, preset_config("fast", samples=1000), device))
    told: list[Progress] = []
    first = TrackProgress(told.append, rounds=10)
    second = first.silent_track()
    first.tell(state, "refine", 1, 0.5)
    second.tell(state, "refine", 2, 0.0)
    assert len(told) == 1 and told[0].round == 2
    first.tell(state, "refine", 1, 0.5)
    assert told[1].round == 4 and told[1].fraction > told[0].fraction
