"""Regions that existing primitives suggest: what one of them holds, to be split, and what two hold, to be merged."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from .region import Region, region_from_mask

SMALLEST = 24
"""Cells below which a part is not worth another look."""


def label_parts(grid: np.ndarray, owners_at: np.ndarray, coarse_cells: np.ndarray) -> np.ndarray:
    """Which primitive each cell of the target belongs to.

    Args:
        grid: (n, n, n) signed distance of the target, n even.
        owners_at: (m,) primitive nearest to each coarse cell's centre.
        coarse_cells: (m,) flat indices into the (n/2)^3 grid, from `coarse_inside`.

    Returns:
        (n, n, n) int32, -1 outside the target.
    """
    half = grid.shape[0] // 2
    labels = np.full(half**3, -1, np.int32)
    labels[coarse_cells] = owners_at
    fine = labels.reshape(half, half, half).repeat(2, 0).repeat(2, 1).repeat(2, 2)
    return np.where(grid < 0, fine, -1)


def coarse_inside(grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cells of the half-resolution grid that hold any of the target: flat indices, centres (m, 3) normalised."""
    half = grid.shape[0] // 2
    inside = grid < 0
    pairs = inside[0::2] | inside[1::2]
    rows = pairs[:, 0::2] | pairs[:, 1::2]
    cells = np.flatnonzero(rows[:, :, 0::2] | rows[:, :, 1::2])
    index = np.stack(np.unravel_index(cells, (half, half, half)), 1)
    return cells, (-1.0 + (index + 0.5) * (2.0 / half)).astype(np.float32)


def neighbour_pairs(labels: np.ndarray, count: int) -> list[tuple[int, int]]:
    """Pairs of parts that touch, those with the most contact for the smaller one's size first."""
    contacts = np.zeros(count * count, np.int64)
    for axis in range(3):
        a: list[slice] = [slice(None)] * 3
        b = list(a)
        a[axis], b[axis] = slice(None, -1), slice(1, None)
        first, second = labels[tuple(a)], labels[tuple(b)]
        touching = (first != second) & (first >= 0) & (second >= 0)
        contacts += np.bincount(first[touching] * count + second[touching], minlength=count * count)
    contacts = contacts.reshape(count, count)
    contacts += contacts.T
    sizes = np.bincount(labels[labels >= 0], minlength=count)
    first, second = np.nonzero(np.triu(contacts))
    share = contacts[first, second] / np.maximum(np.minimum(sizes[first], sizes[second]), 1) ** (2 / 3)
    order = np.argsort(-share, kind="stable")
    return [(int(first[i]), int(second[i])) for i in order]


def part_regions(labels: np.ndarray, parts: list[tuple[int, ...]], source: str) -> list[Region]:
    """One region for each group of parts, cropped to its box; groups of too few cells are left out."""
    resolution = labels.shape[0]
    boxes = ndimage.find_objects(labels + 1)
    regions = []
    for group in parts:
        held = [boxes[part] for part in group if part < len(boxes) and boxes[part] is not None]
        if not held:
            continue
        lower = [min(box[axis].start for box in held) for axis in range(3)]
        upper = [max(box[axis].stop for box in held) for axis in range(3)]
        within = labels[tuple(slice(a, b) for a, b in zip(lower, upper, strict=True))]
        mask = within == group[0]
        for other in group[1:]:
            mask |= within == other
        region = region_from_mask(mask, np.array(lower, np.int32), resolution, source)
        if region is not None and region.volume >= SMALLEST:
            regions.append(region)
    return regions


def halves(region: Region) -> list[Region]:
    """The region cut across its two longest principal axes, at the middle: four overlapping proposals."""
    centres = region.centres().astype(np.float64)
    middle = centres.mean(0)
    _, axes = np.linalg.eigh(np.cov((centres - middle).T) + 1e-12 * np.eye(3))
    found = []
    for axis in axes.T[:0:-1]:
        along = (centres - middle) @ axis
        cut = 0.5 * (along.min() + along.max())
        for side in (along < cut, along >= cut):
            mask = np.zeros(region.mask.shape, bool)
            mask.ravel()[np.flatnonzero(region.mask)[side]] = True
            half = region_from_mask(mask, region.lower, region.resolution, f"half {region.source}")
            if half is not None and half.volume >= SMALLEST:
                found.append(half)
    return found
