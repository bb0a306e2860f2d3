"""A proposal: one way to find regions that may be worth a primitive each."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import warp as wp

from ..coarse_grid import WorkingGrid, working_grid
from ..region import Region
from ..residual import Residual


@dataclass(frozen=True)
class Unexplained:
    """Unexplained residual that proposals take apart, and how much of it."""

    residual: Residual
    device: wp.Device
    """Where distances are measured."""
    most: int = 64
    """Regions of a proposal that has no limit of its own, the largest ones."""
    seed: int = 0

    @cached_property
    def grid(self) -> WorkingGrid:
        """The residual at the resolution that most proposals work at."""
        return working_grid(self.residual)


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """A source of regions, and when it is asked."""

    name: str
    """Unique; the first word of its regions' `source`, unless `sources` has others."""
    find: Callable[[Unexplained], Iterable[Region | None]]
    """The regions; None stands for one that is too small."""
    rank: int = 100
    """Of regions that nearly equal each other and have one volume, that of the lowest rank stays."""
    sources: tuple[str, ...] = ()
    title: str = ""
    """What a fit can do without, as in "no slabs": a row of the ablation. Empty if it is part of every fit."""
    first_round: bool = False
    """Whether it is asked only while there is no primitive."""
    bulky: bool = False
    """Whether its regions are big, perhaps perforated: a greedy choice takes them and never gets to their parts."""
    alone: bool = False
    """Whether it stands in the place of all others, where --decompose names it."""
