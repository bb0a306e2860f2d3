"""Starting primitives for regions: rows of many hypotheses of what each is, of which fitting keeps the best.

The rows of a family are the hypotheses that its parameters can express.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...decomposition.region import Region, spread_indices
from ...kernels.primitives import DEFAULT_FAMILY
from ...kernels.primitives import family as find_family
from ...kernels.rotation import quaternion_of
from ...kernels.rows import ROTATION, ROW, SHAPE, SHAPES, TRANSLATION, empty_rows
from .hypotheses import Hypotheses, guess_shapes

STARTS = 33
"""Hypotheses a region, at most."""

SAMPLES = 512
"""Points of a region that starts are estimated from."""

HALF_CELL = 1.0 / 128.0
"""Half a cell of a grid of 128, for points that come without a grid."""


def all_starts(
    regions: Sequence[Region | np.ndarray], family: str = DEFAULT_FAMILY, count: int = STARTS
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Starting rows for regions, the likeliest and most different hypotheses of each first.

    Args:
        regions: each a region, or points (m, 3) spread over its volume, normalised frame, from a grid of 128.
        family: of the primitives.
        count: rows a region, at most.

    Returns:
        Rows (s, ROW) float32 with blend 0 and gate 1, the region (s,) int32 that each is for, and their kinds; none
        for a region without points.
    """
    entry = find_family(family)
    samples = [_sample(region) for region in regions]
    present = [index for index, points in enumerate(samples) if len(points)]
    if not present:
        return empty_rows(0), np.zeros(0, np.int32), []
    points = np.stack([samples[index] for index in present]).astype(np.float64)
    cells = [regions[index] for index in present]
    half_cell = np.array([1.0 / cell.resolution if isinstance(cell, Region) else HALF_CELL for cell in cells])
    covariance = np.stack([_covariance(cell) for cell in cells])
    guesses = guess_shapes(points, covariance, half_cell)
    shapes, near = entry.starts(entry, guesses.solids)
    guesses, shapes = guesses.take(near), shapes[near]
    first = _place_in_group(guesses.region) < count
    guesses, shapes = guesses.take(first), shapes[first]
    owners = np.array(present, np.int32)[guesses.region]
    return _hypothesis_rows(guesses, shapes), owners, guesses.kind.tolist()


def _sample(region: Region | np.ndarray) -> np.ndarray:
    """SAMPLES points, some of them repeated where there are fewer; none if there are none."""
    points = region.sample(SAMPLES) if isinstance(region, Region) else np.asarray(region)
    if len(points) == 0 or len(points) == SAMPLES:
        return points
    return points[spread_indices(len(points), SAMPLES)]


def _covariance(region: Region | np.ndarray) -> np.ndarray:
    """Covariance (3, 3) of a region's points."""
    if isinstance(region, Region):
        return region.covariance()
    centred = region - region.mean(axis=0)
    return centred.T @ centred / len(region)


def _place_in_group(owner: np.ndarray) -> np.ndarray:
    """Place of each entry among the equal ones of a sorted array."""
    return np.arange(len(owner)) - np.searchsorted(owner, owner)


def _hypothesis_rows(guesses: Hypotheses, shapes: np.ndarray) -> np.ndarray:
    """Rows (g, ROW) float32 of hypotheses with their shapes (g, SHAPE)."""
    rows = empty_rows(len(guesses.region))
    rows[:, SHAPES : SHAPES + SHAPE] = shapes
    rows[:, TRANSLATION : TRANSLATION + 3] = guesses.centre
    rows[:, ROTATION : ROTATION + 4] = quaternion_of(guesses.axes)
    return rows.reshape(-1, ROW)
