"""Slabs between the places where a solid's cross-section changes: what turned, stacked and extruded things are made of.

A cup is a foot, a stem, a floor and a wall along its axis. Morphological decomposition parts none of them, since they
are about as thick as each other; the cross-section jumps where one ends.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy import ndimage

from .coarse import WorkingGrid
from .region import Region, label_components

LEAST_CHANGE = 0.1
"""Share of a cross-section that has to change within a few cells for a cut."""

MOST_CUTS = 6
"""Cuts across one axis, at most: where the change is greatest."""

SMALLEST_SHARE = 0.02
"""Share of the residual below which a piece is left to the other proposals."""

MOST_PIECES = 4
"""Pieces of one slab, at most."""


def section_parts(grid: WorkingGrid) -> list[Region]:
    """Connected pieces of the slabs between changes of the cross-section, along each axis, with source "slab"."""
    solid = grid.depth > 0.0
    smallest = max(1, int(SMALLEST_SHARE * np.count_nonzero(solid)))
    regions = []
    for axis in range(3):
        cuts = section_cuts(np.moveaxis(solid, axis, 0))
        edges = [0, *cuts, solid.shape[axis]]
        if not cuts:
            continue
        for begin, end in pairwise(edges):
            for piece in _pieces(solid, axis, begin, end, smallest):
                region = grid.region(piece, "slab")
                if region is not None:
                    regions.append(region)
    return regions


def section_cuts(solid: np.ndarray) -> list[int]:
    """Places between which the sections of `solid` (n, a, b) along its first axis are alike, ascending.

    A cut c parts section c - 1 from section c.
    """
    count = len(solid)
    flat = solid.reshape(count, -1)
    area = np.count_nonzero(flat, axis=1)
    change = np.zeros(count)
    for place in range(1, count):
        # Over three cells too, since a slanted face takes some; the nearer pair tells where.
        for low, high in ((place - 1, place), (max(place - 2, 0), min(place + 1, count - 1))):
            largest = max(area[low], area[high], 1)
            change[place] += 0.5 * np.count_nonzero(flat[low] ^ flat[high]) / largest
    cuts: list[int] = []
    for place in np.argsort(-change, kind="stable"):
        if change[place] < LEAST_CHANGE or len(cuts) == MOST_CUTS:
            break
        if all(abs(place - cut) > 2 for cut in cuts) and 1 < place < count - 1:
            cuts.append(int(place))
    return sorted(cuts)


def _pieces(solid: np.ndarray, axis: int, begin: int, end: int, smallest: int) -> list[np.ndarray]:
    """Masks like `solid` of the components (6) of a slab of at least `smallest` cells, largest first."""
    slab: list[slice] = [slice(None)] * 3
    slab[axis] = slice(begin, end)
    box = tuple(slab)
    labels, count = label_components(solid[box])
    volumes = np.bincount(labels.reshape(-1), minlength=count + 1)[1:]
    boxes = ndimage.find_objects(labels)
    pieces = []
    for index in np.argsort(-volumes, kind="stable")[:MOST_PIECES]:
        if volumes[index] < smallest:
            break
        piece = np.zeros(solid.shape, bool)
        piece[box][boxes[index]] = labels[boxes[index]] == index + 1
        pieces.append(piece)
    return pieces
