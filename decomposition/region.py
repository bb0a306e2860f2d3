"""A region: the cells that one primitive is to explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from scipy import ndimage

from ..kernels.grid.sparse_cells import coordinates, true_cells

SAME_SHARE = 0.9
"""Two regions that share more than this of their union are one proposal."""

_JITTER_SEED = 7
"""Samples of a region are drawn with the same random numbers every time, so that proposals are reproducible."""


@dataclass(frozen=True, eq=False)
class Region:
    """Some cells of the resolution^3 grid over [-1, 1]^3, indexed [x, y, z]."""

    lower: np.ndarray
    """(3,) int32, the cell at [0, 0, 0] of `mask`."""
    mask: np.ndarray
    """(a, b, c) bool; every face of the box holds a cell of the region."""
    resolution: int
    """Cells along a side of the grid."""
    source: str
    """How it was proposed: "solid", "component", "plate", "beam" or "msd 0.03", with the volume fraction."""

    @cached_property
    def volume(self) -> int:
        """Number of cells."""
        return int(np.count_nonzero(self.mask))

    def centres(self) -> np.ndarray:
        """Centres (volume, 3) float32 of the cells, normalised frame, in the order of the grid."""
        return self.centres_of(true_cells(self.mask))

    def sample(self, count: int) -> np.ndarray:
        """At most `count` of the centres, spread evenly over the region; always the same ones."""
        cells = np.flatnonzero(self.mask)
        if len(cells) > count:
            cells = cells[spread_indices(len(cells), count)]
        return self.centres_of(coordinates(cells, self.mask.shape))

    def centres_of(self, index: np.ndarray) -> np.ndarray:
        """Centres (k, 3) float32, normalised frame, of cells (3, k) of the mask."""
        centres = np.empty(index.shape[::-1], np.float32)
        for axis, low in enumerate(self.lower):
            places = np.arange(low, low + self.mask.shape[axis])
            centres[:, axis] = ((places + 0.5) * (2.0 / self.resolution) - 1.0)[index[axis]]
        return centres

    def covariance(self) -> np.ndarray:
        """Covariance (3, 3) of the cells' centres, normalised frame: of all of them, unlike that of a sample."""
        # Sums over one axis hold all first and second moments; the narrower the type, the faster they are.
        mask, narrow = self.mask.view(np.uint8), np.min_scalar_type(max(self.mask.shape))
        xy, xz, yz = (mask.sum(axis=axis, dtype=narrow).astype(np.float64) for axis in (2, 1, 0))
        places = [np.arange(size, dtype=np.float64) for size in self.mask.shape]
        masses = [xy.sum(axis=1), xy.sum(axis=0), yz.sum(axis=0)]
        centre = [mass @ place / self.volume for mass, place in zip(masses, places, strict=True)]
        x, y, z = (place - middle for place, middle in zip(places, centre, strict=True))
        squares = np.diag([mass @ away**2 for mass, away in zip(masses, (x, y, z), strict=True)])
        squares[0, 1] = squares[1, 0] = x @ xy @ y
        squares[0, 2] = squares[2, 0] = x @ xz @ z
        squares[1, 2] = squares[2, 1] = y @ yz @ z
        return squares * ((2.0 / self.resolution) ** 2 / self.volume)

    def describe(self) -> dict[str, object]:
        """Record for a history: source, volume in cells, and the bounding box, [lower, upper) in cells."""
        upper = self.lower + self.mask.shape
        return {
            "source": self.source,
            "volume": self.volume,
            "resolution": self.resolution,
            "lower": [int(edge) for edge in self.lower],
            "upper": [int(edge) for edge in upper],
        }

    def overlap(self, other: Region) -> float:
        """Cells in both over cells in either, 0 to 1; both on the same grid."""
        low = np.maximum(self.lower, other.lower)
        high = np.minimum(self.lower + self.mask.shape, other.lower + other.mask.shape)
        if (high <= low).any():
            return 0.0
        mine = self.mask[_slices(low - self.lower, high - self.lower)]
        theirs = other.mask[_slices(low - other.lower, high - other.lower)]
        both = int(np.count_nonzero(mine & theirs))
        return both / (self.volume + other.volume - both)


def spread_indices(length: int, count: int) -> np.ndarray:
    """`count` indices below `length`, one at random from each of `count` equal runs; always the same ones.

    Evenly spaced ones would fall in step with the rows of a grid.
    """
    return (_jittered(count) * (length / count)).astype(np.int64)


@cache
def _jittered(count: int) -> np.ndarray:
    return np.arange(count) + np.random.default_rng(_JITTER_SEED).random(count)


def region_from_mask(mask: np.ndarray, lower: np.ndarray, resolution: int, source: str) -> Region | None:
    """The region of the true cells of `mask` (a, b, c), whose first cell is `lower`; None if there are none."""
    box = true_box(mask)
    if box is None:
        return None
    start = np.array([edge.start for edge in box], np.int32)
    cropped = np.ascontiguousarray(mask[box])
    return Region(np.asarray(lower, np.int32) + start, cropped, resolution, source)


def true_box(mask: np.ndarray) -> tuple[slice, slice, slice] | None:
    """The smallest box that holds all true cells of a 3D mask; None if there are none."""
    flat: np.ndarray = np.asarray(mask.any(axis=2))
    sides: list[np.ndarray] = [
        np.asarray(flat.any(axis=1)),
        np.asarray(flat.any(axis=0)),
        np.asarray(np.asarray(mask.any(axis=0)).any(axis=0)),
    ]
    if not sides[0].any():
        return None
    first = [int(np.argmax(side)) for side in sides]
    last = [len(side) - int(np.argmax(side[::-1])) for side in sides]
    return slice(first[0], last[0]), slice(first[1], last[1]), slice(first[2], last[2])


def label_components(mask: np.ndarray, full: bool = False) -> tuple[np.ndarray, int]:
    """Labels (a, b, c) int32, 0 outside, 1 and up in the connected parts of a mask, and how many parts there are.

    Cells are connected that share a face (6), with `full` also those that share an edge or a corner (26).
    """
    labels = np.empty(mask.shape, np.int32)
    count = ndimage.label(mask, np.ones((3, 3, 3), bool) if full else None, output=labels)
    return labels, int(np.asarray(count))


def box_table(regions: Sequence[Region]) -> np.ndarray:
    """Lower and upper corner of each region's box in cells, and its volume: (k, 7) float64."""
    rows = [[*region.lower, *(region.lower + region.mask.shape), region.volume] for region in regions]
    return np.array(rows, np.float64).reshape(-1, 7)


def common_boxes(table: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Cells that the boxes of two tables share, (k, m)."""
    low = np.maximum(table[:, None, :3], others[:, :3])
    high = np.minimum(table[:, None, 3:6], others[:, 3:6])
    return np.maximum(high - low, 0).prod(axis=2)


def without_duplicates(regions: Sequence[Region]) -> list[Region]:
    """The regions less those that an earlier one nearly equals (see SAME_SHARE)."""
    table = box_table(regions)
    volume = table[:, 6]
    # Two regions share no more than either has, or their boxes do: most pairs need no look at their cells.
    most = np.minimum(np.minimum(volume[:, None], volume), common_boxes(table, table))
    close = most / (volume[:, None] + volume - most) > SAME_SHARE
    kept: list[int] = []
    for index, region in enumerate(regions):
        alike = [other for other in kept if close[index, other]]
        if not any(region.overlap(regions[other]) > SAME_SHARE for other in alike):
            kept.append(index)
    return [regions[index] for index in kept]


def _slices(low: np.ndarray, high: np.ndarray) -> tuple[slice, slice, slice]:
    return slice(low[0], high[0]), slice(low[1], high[1]), slice(low[2], high[2])
