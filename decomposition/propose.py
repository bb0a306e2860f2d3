"""Which regions are worth a primitive, given what is explained already."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from .box_tree import box_tree_parts
from .coarse_grid import working_grid
from .holes import hole_parts
from .msd import decompose
from .plates_and_beams import straight_parts
from .region import Region, without_duplicates
from .residual import find_residual, residual_components
from .slabs import section_parts
from .target_cells import TargetCells, target_cells

FRACTIONS = (0.005, 0.03, 0.12)
"""Volume fractions of the decompositions: small ones find knobs and limbs, large ones the body."""

MOST_REGIONS = 64


def propose_regions(
    grid: np.ndarray, explained: np.ndarray | None = None, *, most: int = MOST_REGIONS, **options: Any
) -> list[Region]:
    """Regions to fit primitives to: parts of what is unexplained, its connected components, at first all of it.

    Args:
        grid: (n, n, n) float32, signed distance of the target at the cell centres of [-1, 1]^3, negative inside.
        explained: the same of the assembly so far, None if there is none.
        most: regions at most; the largest are kept.
        options: of `find_parts`.

    Returns:
        Regions of at least 12 cells, none nearly equal to another, largest first. Same input, same regions.
    """
    return largest_parts(find_parts(target_cells(grid), explained, most=most, **options), most)


def find_parts(
    target: TargetCells,
    explained: np.ndarray | None,
    *,
    first_round: bool,
    device: wp.Device,
    blocks: bool = True,
    slabs: bool = True,
    holes: bool = True,
    fractions: tuple[float, ...] = FRACTIONS,
    most: int = MOST_REGIONS,
) -> list[Region]:
    """What `propose_regions` picks from: regions of which some are alike, kind by kind.

    Args:
        target: its cells.
        explained: see there.
        first_round: propose the whole residual as one region too.
        device: where distances are measured.
        blocks: propose a tree of boxes' pieces.
        slabs: propose the pieces between changes of the cross-section too: big ones, some of them perforated.
        holes: propose the walls around holes, at first.
        fractions: volume fractions of the morphological decompositions.
        most: connected components at most.
    """
    residual = find_residual(target, explained)
    if residual is None:
        return []
    found = [residual.region(residual.cells.all_places(), "solid")] if first_round else []
    found += residual_components(residual, most=most)
    working = working_grid(residual)
    found += decompose(working, fractions, device)
    found += straight_parts(working)
    if blocks:
        found += box_tree_parts(working)
    if slabs:
        found += section_parts(working)
    if holes and first_round:
        found += hole_parts(working)
    return [region for region in found if region is not None]


def largest_parts(parts: list[Region], most: int) -> list[Region]:
    """At most `most` of some parts, the largest, none nearly equal to another."""
    # The sort is stable: of equal volumes the whole stays before components, and these before parts.
    return without_duplicates(sorted(parts, key=lambda region: -region.volume))[:most]
