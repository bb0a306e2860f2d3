"""Connected regions of a signed distance grid below a level, and the superquadrics that they start as."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ...decomposition.region import label_components, true_box
from ...kernels.rotation import quaternion_of
from ...kernels.rows import ROTATION, SHAPES, TRANSLATION, empty_rows

START_EXPONENTS = (1.0, 1.0)
"""Every superquadric starts as an ellipsoid."""

BALLS = 3
"""Balls that a region starts as beside its boxes."""


@dataclass(frozen=True, eq=False)
class LevelRegion:
    """A connected part of the cells that are deeper than a level."""

    lower: np.ndarray
    """(3,) the cell at [0, 0, 0] of `mask`."""
    mask: np.ndarray
    """(a, b, c) bool."""
    volume: int
    """Number of cells."""
    depth: float
    """The level, in cells: how far the solid reaches at least around every cell."""

    def centres(self) -> np.ndarray:
        """Indices (volume, 3) float64 of the cells in the whole grid."""
        return np.argwhere(self.mask) + self.lower.astype(np.float64)


def regions_below(depth: np.ndarray, level: float, smallest: int, most: int) -> list[LevelRegion]:
    """The 6-connected parts of the cells at least `level` deep, largest first.

    Args:
        depth: (a, b, c) depth inside what is still unexplained, in cells; 0 or less elsewhere.
        level: in cells, above 0.
        smallest: cells that a region must have.
        most: regions returned.
    """
    deep = depth >= level
    box = true_box(deep)
    if box is None:
        return []
    labels, count = label_components(deep[box])
    volumes = np.bincount(labels.reshape(-1), minlength=count + 1)[1:]
    boxes = ndimage.find_objects(labels)
    corner = np.array([edge.start for edge in box])
    regions = []
    for index in np.argsort(-volumes, kind="stable")[:most]:
        if volumes[index] < smallest:
            break
        lower = corner + [edge.start for edge in boxes[index]]
        mask = labels[boxes[index]] == index + 1
        regions.append(LevelRegion(lower, mask, int(volumes[index]), level))
    return regions


def region_candidates(region: LevelRegion, resolution: int) -> np.ndarray:
    """Ellipsoids to start from: the region's box and its principal axes, each with every axis as local z.

    A superquadric's two exponents tell its z axis from the other two, so that each turn is a different start. A region
    that bends away from its own middle (a ring, a sheet with walls) also starts as balls around some of its cells.

    Args:
        region: where.
        resolution: cells along a side of the grid over [-1, 1]^3.

    Returns:
        Rows (candidate_count, ROW) float32 of the family superquadric.
    """
    cells = region.centres()
    spacing = 2.0 / resolution
    frames = []
    for axes in (np.eye(3), _principal_axes(cells)):
        along = cells @ axes
        low, high = along.min(axis=0), along.max(axis=0)
        centre = axes @ (0.5 * (low + high))
        # The solid goes on around the region for as far as the region is deep.
        size = (high - low + 1.0 + 2.0 * region.depth) * spacing
        frames.append((axes, (centre + 0.5) * spacing - 1.0, size))
    rows = empty_rows(3 * len(frames))
    for number, (axes, centre, size) in enumerate(frames):
        for turn, order in enumerate(((0, 1, 2), (1, 2, 0), (2, 0, 1))):
            row = rows[3 * number + turn]
            row[TRANSLATION : TRANSLATION + 3] = centre
            row[ROTATION : ROTATION + 4] = quaternion_of(axes[:, order])
            row[SHAPES : SHAPES + 3] = size[list(order)]
            row[SHAPES + 3 : SHAPES + 5] = START_EXPONENTS
    balls = empty_rows(BALLS)
    balls[:, TRANSLATION : TRANSLATION + 3] = (_spread_cells(cells, BALLS) + 0.5) * spacing - 1.0
    balls[:, SHAPES : SHAPES + 3] = 2.0 * (region.depth + 1.0) * spacing
    balls[:, SHAPES + 3 : SHAPES + 5] = START_EXPONENTS
    return np.concatenate([rows, balls])


def _spread_cells(cells: np.ndarray, count: int) -> np.ndarray:
    """The cell (count, 3) nearest to the middle of all, then each time the one farthest from those chosen."""
    away = ((cells - cells.mean(axis=0)) ** 2).sum(axis=1)
    chosen = [int(away.argmin())]
    nearest = ((cells - cells[chosen[0]]) ** 2).sum(axis=1)
    while len(chosen) < count:
        chosen.append(int(nearest.argmax()))
        np.minimum(nearest, ((cells - cells[chosen[-1]]) ** 2).sum(axis=1), out=nearest)
    return cells[chosen]


def _principal_axes(cells: np.ndarray) -> np.ndarray:
    """Right-handed principal axes (3, 3) of points (n, 3), in columns."""
    centred = cells - cells.mean(axis=0)
    axes = np.linalg.eigh(centred.T @ centred)[1]
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    return axes
