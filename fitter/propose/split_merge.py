"""Regions that existing primitives suggest: what one of them holds, to be split, and what two hold, to be merged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...decomposition.region import Region
from ...decomposition.target_cells import TargetCells
from ...kernels.grid.sparse_cells import Survey, crop, survey_parts, true_cells

SMALLEST = 24
"""Cells below which a part is not worth another look."""


@dataclass(frozen=True)
class CoarseCells:
    """The cells of half the resolution that hold any of a target's, at whose centres owners are found."""

    centres: np.ndarray
    """(k, 3) float32, normalised frame."""
    around: np.ndarray
    """(m,) the coarse cell that each cell of the target is in."""


@dataclass(frozen=True)
class Parts:
    """Partition of a target among primitives."""

    target: TargetCells
    labels: np.ndarray
    """(a, b, c) int16 on the target's box: the primitive that a cell belongs to, -1 outside the target."""
    sizes: np.ndarray
    """(count,) cells."""
    survey: Survey
    """Their boxes and contacts."""


def coarse_cells(target: TargetCells) -> CoarseCells:
    """The coarse cells of a target on a grid of an even number of cells."""
    half = target.resolution // 2
    x, y, z = (target.cells.index + target.lower[:, None]) // 2
    flat = (x * half + y) * half + z
    held = np.zeros(half**3, bool)
    held[flat] = True
    index = np.stack(np.unravel_index(np.flatnonzero(held), (half, half, half)), 1)
    centres = (-1.0 + (index + 0.5) * (2.0 / half)).astype(np.float32)
    return CoarseCells(centres, (np.cumsum(held) - 1)[flat])


def divide(target: TargetCells, part: np.ndarray, count: int) -> Parts:
    """The parts of a target that `count` primitives hold, given the one (m,) int32 that each cell belongs to."""
    cells = target.cells
    labels = np.full(cells.shape, -1, np.int16)
    labels[tuple(cells.index)] = part
    return Parts(target, labels, np.bincount(part, minlength=count), survey_parts(cells, part, count))


def neighbour_pairs(parts: Parts) -> list[tuple[int, int]]:
    """Pairs of parts that touch, those with the most contact for the smaller one's size first."""
    contacts, sizes = parts.survey.contacts + parts.survey.contacts.T, parts.sizes
    first, second = np.nonzero(np.triu(contacts))
    share = contacts[first, second] / np.maximum(np.minimum(sizes[first], sizes[second]), 1) ** (2 / 3)
    order = np.argsort(-share, kind="stable")
    return [(int(first[i]), int(second[i])) for i in order]


def part_regions(parts: Parts, groups: list[tuple[int, ...]], source: str) -> list[Region]:
    """One region for each group of parts, cropped to its box; groups of too few cells are left out."""
    target, regions = parts.target, []
    for group in groups:
        held = [part for part in group if parts.sizes[part]]
        if parts.sizes[held].sum() < SMALLEST:
            continue
        lower, upper = parts.survey.lower[held].min(axis=0), parts.survey.upper[held].max(axis=0)
        within = parts.labels[tuple(slice(a, b) for a, b in zip(lower, upper, strict=True))]
        mask = within == held[0]
        for other in held[1:]:
            mask |= within == other
        regions.append(Region(target.lower + lower, mask, target.resolution, source))
    return regions


def halves(region: Region) -> list[Region]:
    """The region cut across its two longest principal axes, at the middle: four overlapping proposals."""
    index = true_cells(region.mask)
    centres = region.centres_of(index).astype(np.float64)
    offset = centres - centres.mean(0)
    _, axes = np.linalg.eigh(np.cov(offset.T) + 1e-12 * np.eye(3))
    found = []
    for axis in axes.T[:0:-1]:
        along = offset @ axis
        below = along < 0.5 * (along.min() + along.max())
        for side in (np.flatnonzero(below), np.flatnonzero(~below)):
            if len(side) >= SMALLEST:
                lower, mask = crop(index.take(side, axis=1))
                found.append(Region(region.lower + lower, mask, region.resolution, f"half {region.source}"))
    return found
