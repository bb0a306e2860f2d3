"""Proposals of a round: regions of what is unexplained, candidates for them, and which of these to refine."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ...decomposition.proposals import PROPOSALS, proposal_of, proposals_for
from ...decomposition.propose import find_parts, largest_parts
from ...decomposition.region import Region
from ..config import FitConfig
from ..propose.candidates import seed_regions
from ..propose.split_merge import halves, neighbour_pairs, part_regions
from ..refine.refiner import REFINERS
from ..select.selection import select
from .assess import errors
from .context import SearchContext
from .state import SearchState

ADAM_SEEDS = 7
"""Regions that a round seeds with the paper's optimiser: its seven steps of decomposition."""


class Proposals(Protocol):
    """A way to come from what is unexplained to the primitives that a round refines."""

    def regions(self, context: SearchContext, state: SearchState) -> list[Region]:
        """Regions that may become primitives, found by morphology."""
        ...

    def candidates(
        self, context: SearchContext, state: SearchState, regions: list[Region], number: int
    ) -> np.ndarray:
        """Candidates (count, ROW) for regions in round `number`."""
        ...

    def choose(
        self,
        context: SearchContext,
        state: SearchState,
        pool: np.ndarray,
        candidates: int,
        false_volume: float,
    ) -> list[int]:
        """Indices into the pool: first `candidates` of them, then the primitives so far, which may be swapped out."""
        ...


class FittedProposals:
    """Candidates fitted to regions and remembered from round to round; those that pay are selected."""

    def regions(self, context: SearchContext, state: SearchState) -> list[Region]:
        """As `Proposals`, with regions of what the primitives so far hold."""
        regions = _largest_regions(context, state)
        return regions + (neighbour_regions(context, state) if len(state.rows) else [])

    def candidates(
        self, context: SearchContext, state: SearchState, regions: list[Region], number: int
    ) -> np.ndarray:
        """As `Proposals`: those of this and earlier rounds."""
        config = context.config
        return state.candidate_pool.fit_new(regions, context.target.grid, config, config.seed + number)

    def choose(
        self,
        context: SearchContext,
        state: SearchState,
        pool: np.ndarray,
        candidates: int,
        false_volume: float,
    ) -> list[int]:
        """As `Proposals`, by greedy selection."""
        with state.candidate_pool.joined_by(pool[state.candidate_pool.coverage.count :]) as coverage:
            return select(
                coverage,
                context.tally,
                state.alpha,
                context.config.select,
                false_volume,
                range(candidates, len(pool)),
                context.config.max_primitives,
            )


class SeededProposals:
    """The paper's way: a seed for each region of a decomposition; optimisation and pruning decide."""

    def regions(self, context: SearchContext, state: SearchState) -> list[Region]:
        """As `Proposals`."""
        found, wanted = _largest_regions(context, state), context.config.decompose
        return [region for region in found if proposal_of(region).name == wanted][:ADAM_SEEDS]

    def candidates(
        self, context: SearchContext, state: SearchState, regions: list[Region], number: int
    ) -> np.ndarray:
        """As `Proposals`, not fitted."""
        return seed_regions(regions, context.config.primitive).rows

    def choose(
        self,
        context: SearchContext,
        state: SearchState,
        pool: np.ndarray,
        candidates: int,
        false_volume: float,
    ) -> list[int]:
        """As `Proposals`: all, as far as so many are allowed."""
        return [*range(candidates, len(pool)), *range(candidates)][: context.config.max_primitives]


def proposals_of(context: SearchContext) -> Proposals:
    """The proposals that the refiner of a fit goes on from."""
    return SeededProposals() if context.refiner.selects else FittedProposals()


def is_baseline(config: FitConfig) -> bool:
    """True for a baseline, a method of others to compare with: it goes without steps that are not its own."""
    return REFINERS[config.optimizer].selects or PROPOSALS[config.decompose].alone


def cut(context: SearchContext, state: SearchState) -> list[Region]:
    """Regions of what is unexplained, and of what the primitives so far hold."""
    if PROPOSALS[context.config.decompose].alone:
        return _largest_regions(context, state)
    return proposals_of(context).regions(context, state)


def unexplained_parts(context: SearchContext, state: SearchState, slabs: bool) -> list[Region]:
    """Parts of what is unexplained, with or without slabs and other bulky ones."""
    config, propose = context.config, context.config.propose
    return find_parts(
        context.target_cells,
        state.grid_field,
        first_round=not len(state.rows),
        device=context.device,
        proposals=proposals_for(config.decompose, propose.without, bulky=slabs),
        most=propose.regions,
        seed=config.seed,
    )


def neighbour_regions(context: SearchContext, state: SearchState) -> list[Region]:
    """Parts of what single primitives hold, where they fit badly, and what touching pairs hold, to be merged."""
    settings, parts = context.config.propose, context.parts(state.rows)
    pairs = neighbour_pairs(parts)[: settings.merges]
    worst = np.argsort(-errors(context, state), kind="stable")[: settings.splits]
    singles = part_regions(parts, [(int(k),) for k in worst], "part")
    split = [half for region in singles for half in halves(region)]
    return singles + split + part_regions(parts, pairs, "pair")


def _largest_regions(context: SearchContext, state: SearchState) -> list[Region]:
    """The largest parts of what is unexplained; of the whole, those that two tracks share."""
    if state.grid_field is None and state.beginning is not None:
        parts = [part for part in state.beginning if state.slabs or not proposal_of(part).bulky]
    else:
        parts = unexplained_parts(context, state, state.slabs)
    return largest_parts(parts, context.config.propose.regions)
