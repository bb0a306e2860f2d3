"""Proposal of regions that are worth a primitive, given what is explained already."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from .proposals import Proposal, Unexplained, proposals_for
from .region import Region, without_duplicates
from .residual import find_residual
from .target_cells import TargetCells

MOST_REGIONS = 64


def find_parts(
    target: TargetCells,
    explained: np.ndarray | None,
    *,
    first_round: bool,
    device: wp.Device,
    proposals: Sequence[Proposal] | None = None,
    most: int = MOST_REGIONS,
    seed: int = 0,
) -> list[Region]:
    """Regions to fit primitives to, proposal by proposal, some of them alike: parts of what is unexplained.

    Args:
        target: its cells.
        explained: (n, n, n) float32, signed distance of the assembly so far at the cell centres of [-1, 1]^3,
            negative inside; None if there is none.
        first_round: whether to ask the proposals of a first round too.
        device: where distances are measured.
        proposals: those to ask; all that stand not alone unless given.
        most: regions at most of a proposal without a limit of its own.
        seed: of proposals that draw random numbers.
    """
    residual = find_residual(target, explained)
    if residual is None:
        return []
    unexplained = Unexplained(residual, device, most, seed)
    asked = proposals_for("msd") if proposals is None else proposals
    found = [proposal.find(unexplained) for proposal in asked if first_round or not proposal.first_round]
    return [region for regions in found for region in regions if region is not None]


def largest_parts(parts: list[Region], most: int) -> list[Region]:
    """At most `most` of some parts, the largest, none nearly equal to another."""
    # The sort is stable: of equal volumes the whole stays before components, and these before parts.
    return without_duplicates(sorted(parts, key=lambda region: -region.volume))[:most]
