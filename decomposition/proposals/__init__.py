"""The registry of proposals: one file each, found by scanning this folder for modules that define `PROPOSAL`."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Sequence

from resfit.errors import InputError

from ..region import Region
from .proposal import Proposal, Unexplained

__all__ = ["PROPOSALS", "Proposal", "Unexplained", "check_without", "proposal_of", "proposals_for"]


def _scan() -> dict[str, Proposal]:
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    modules = [importlib.import_module(f"{__name__}.{name}") for name in names]
    found = [module.PROPOSAL for module in modules if hasattr(module, "PROPOSAL")]
    return {proposal.name: proposal for proposal in sorted(found, key=lambda proposal: proposal.rank)}


PROPOSALS: dict[str, Proposal] = _scan()
"""Every proposal by its name, that of the lowest rank first."""


def proposals_for(decompose: str, without: Sequence[str] = (), bulky: bool = True) -> list[Proposal]:
    """The proposals of a fit.

    Args:
        decompose: name of one that stands alone; that of any other is all others.
        without: names of those to leave out.
        bulky: whether those with bulky regions are among them.
    """
    if PROPOSALS[decompose].alone:
        return [PROPOSALS[decompose]]
    return [
        proposal
        for name, proposal in PROPOSALS.items()
        if not proposal.alone and name not in without and (bulky or not proposal.bulky)
    ]


def proposal_of(region: Region) -> Proposal:
    """The proposal that a region comes from."""
    first = region.source.split()[0]
    return next(entry for entry in PROPOSALS.values() if first in (entry.sources or (entry.name,)))


def check_without(names: Sequence[str]) -> None:
    """Refuse names of proposals that a fit cannot do without.

    Raises:
        InputError: if there is one.
    """
    optional = [name for name, proposal in PROPOSALS.items() if proposal.title]
    for name in names:
        if name not in optional:
            raise InputError(
                f"propose.without {name}: there is no such proposal to leave out; choose {', '.join(optional)}."
            )
