"""All of the residual as one region."""

from __future__ import annotations

from ..region import Region
from .proposal import Proposal, Unexplained


def whole_region(unexplained: Unexplained) -> list[Region | None]:
    """The residual, with source "solid"."""
    residual = unexplained.residual
    return [residual.region(residual.cells.all_places(), "solid")]


PROPOSAL = Proposal(name="solid", find=whole_region, rank=0, first_round=True)
