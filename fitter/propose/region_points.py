"""Sample points of a region: what a primitive that is to fill it should match."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...decomposition.region import Region
from ...kernels.grid.sparse_cells import coordinates

INSIDE_SHARE, OUTSIDE_SHARE = 0.45, 0.4
"""Shares of a region's points that lie in it and outside the solid; the rest lies in other parts of the solid."""

OTHER_WEIGHT = 0.4
"""Square root of the weight of points in other parts of the solid: filling them is an overlap, no error."""


@dataclass(frozen=True)
class RegionPoints:
    """Points of all regions, one after the other."""

    points: np.ndarray
    """(n, 3) float32, normalised frame."""
    region: np.ndarray
    """(n,) the region of each point."""
    distance: np.ndarray
    """(n,) float32 signed distance that a primitive of the region should have there."""
    weight: np.ndarray
    """(n,) float32, square roots of weights."""
    scale: np.ndarray
    """(region_count,) largest depth inside each region, normalised units: half its thickness."""

    def half(self) -> RegionPoints:
        """Every other point."""
        return RegionPoints(
            self.points[::2], self.region[::2], self.distance[::2], self.weight[::2], self.scale
        )


def sample_regions(regions: list[Region], grid: np.ndarray, count: int, seed: int) -> RegionPoints:
    """`count` points of each region's surroundings, at cell centres of the target's grid.

    Args:
        regions: parts of the solid.
        grid: (n, n, n) signed distance of the target at the cell centres of [-1, 1]^3.
        count: points a region, a multiple of the normal equations' block.
        seed: of the choice of cells.
    """
    rng = np.random.default_rng(seed)
    parts = [_sample_region(region, grid, count, rng) for region in regions]
    points, distances, weights, scales = zip(*parts, strict=True)
    sizes = [len(part) for part in points]
    return RegionPoints(
        np.concatenate(points),
        np.repeat(np.arange(len(regions)), sizes),
        np.concatenate(distances),
        np.concatenate(weights),
        np.array(scales),
    )


def _sample_region(
    region: Region, grid: np.ndarray, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    resolution = grid.shape[0]
    shape = np.array(region.mask.shape)
    margin = np.maximum(2, (0.15 * shape.max()).astype(int))
    low = np.maximum(region.lower - margin, 0)
    high = np.minimum(region.lower + shape + margin, resolution)
    box = np.ascontiguousarray(grid[tuple(slice(*edges) for edges in zip(low, high, strict=True))])
    at = region.lower - low
    inner = tuple(slice(begin, begin + size) for begin, size in zip(at, shape, strict=True))
    inside_cells = np.flatnonzero(region.mask)
    outside_cells = np.flatnonzero(box > 0)
    other = box <= 0
    other[inner] &= ~region.mask
    other_cells = np.flatnonzero(other)
    wanted_other = int(count * (1 - INSIDE_SHARE - OUTSIDE_SHARE)) if len(other_cells) else 0
    wanted_inside = int(count * INSIDE_SHARE)
    wanted_outside = count - wanted_inside - wanted_other if len(outside_cells) else 0
    wanted_inside = count - wanted_outside - wanted_other
    index = np.concatenate(
        [
            coordinates(_choose(inside_cells, wanted_inside, rng), region.mask.shape) + at[:, None],
            coordinates(_choose(outside_cells, wanted_outside, rng), box.shape),
            coordinates(_choose(other_cells, wanted_other, rng), box.shape),
        ],
        axis=1,
    )
    spacing = 2.0 / resolution
    points = (-1.0 + (index.T + low + 0.5) * spacing).astype(np.float32)
    distance = box[tuple(index)].astype(np.float32)
    weight = np.ones(count, np.float32)
    distance[wanted_inside + wanted_outside :] = spacing
    weight[wanted_inside + wanted_outside :] = OTHER_WEIGHT
    depth = float(-box[inner][region.mask].min(initial=-0.5 * spacing))
    return points, distance, weight, depth


def _choose(cells: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """`count` of the cells, spread evenly over their order; repeated where there are too few."""
    if count == 0:
        return cells[:0]
    places = (np.arange(count) + rng.uniform(size=count)) * (len(cells) / count)
    return cells[np.minimum(places.astype(int), len(cells) - 1)]
