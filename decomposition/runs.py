"""Plates and beams that lie along the axes: what furniture, brackets and housings are made of.

Morphological decomposition cannot part walls of one thickness that meet: they are as deep as each other. The lengths
of the runs of cells through a cell along x, y and z tell them apart.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from .coarse import WorkingGrid
from .region import Region, label_components, true_box

SLIMNESS = 2
"""A plate is this many times wider than thick, a beam as many times longer than wide."""

SMALLEST_SHARE = 0.01
"""Share of the residual below which a plate or beam is left to the other proposals."""

MOST_PARTS = 8
"""Plates across one axis, and beams along it, at most."""


def straight_parts(grid: WorkingGrid) -> list[Region]:
    """Connected plates across each axis and beams along it, with source "plate" and "beam"."""
    solid = grid.depth > 0.0
    lengths = [run_lengths(solid, axis) for axis in range(3)]
    smallest = max(1, int(SMALLEST_SHARE * np.count_nonzero(solid)))
    regions = []
    for axis in range(3):
        along, one, two = lengths[axis], lengths[axis - 2], lengths[axis - 1]
        plates = solid & (along * SLIMNESS <= np.minimum(one, two))
        beams = solid & (along >= SLIMNESS * np.maximum(one, two))
        for mask, source in ((plates, "plate"), (beams, "beam")):
            for part in _largest_parts(mask, smallest):
                region = grid.region(part, source)
                if region is not None:
                    regions.append(region)
    return regions


def run_lengths(solid: np.ndarray, axis: int) -> np.ndarray:
    """Number of cells (a, b, c) int16 in the unbroken run along `axis` through each true cell, 0 at others."""
    turned = np.moveaxis(solid, axis, 0)
    count = len(turned)
    place = np.arange(count, dtype=np.int16)[:, None, None]
    before = np.maximum.accumulate(np.where(turned, np.int16(-1), place), axis=0)
    after = np.minimum.accumulate(np.where(turned, np.int16(count), place)[::-1], axis=0)[::-1]
    return np.moveaxis(np.where(turned, after - before - np.int16(1), np.int16(0)), 0, axis)


def _largest_parts(mask: np.ndarray, smallest: int) -> list[np.ndarray]:
    """Masks (a, b, c) of the components (6) of at least `smallest` cells, at most MOST_PARTS, largest first."""
    box = true_box(mask)
    if box is None or np.count_nonzero(mask) < smallest:
        return []
    labels, count = label_components(mask[box])
    volumes = np.bincount(labels.reshape(-1), minlength=count + 1)[1:]
    boxes = ndimage.find_objects(labels)
    parts = []
    for index in np.argsort(-volumes, kind="stable")[:MOST_PARTS]:
        if volumes[index] < smallest:
            break
        part = np.zeros(mask.shape, bool)
        part[box][boxes[index]] = labels[boxes[index]] == index + 1
        parts.append(part)
    return parts
