"""The grid that a residual is taken apart on: half the resolution, where that keeps its shape."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage

from ..kernels.grid.sparse_cells import CellSet, cells_of
from .region import Region, region_from_mask
from .residual import SMALLEST_VOLUME, Residual

COARSE_VOLUME = 20_000
"""Residuals of more cells are decomposed at half the resolution, if that keeps their shape."""

COARSE_SHARE = 0.93
"""Share of the cells that the coarse grid must keep; thin parts vanish from it first."""


@dataclass(frozen=True)
class WorkingGrid:
    """A residual at the resolution that it is taken apart at."""

    residual: Residual
    """At full resolution; cell [0, 0, 0] of both begins at the same corner."""
    coarse: np.ndarray | None
    """(a, b, c) float32, depth in cells twice those of the residual, 0 or less outside of it; None for its own."""

    @cached_property
    def cells(self) -> CellSet:
        """The solid cells of this grid."""
        return self.residual.cells if self.coarse is None else cells_of(self.coarse > 0.0)

    @property
    def depths(self) -> np.ndarray:
        """Depth (m,) float32 of each, in cells of this grid."""
        return self.residual.depths if self.coarse is None else self.coarse[self.coarse > 0.0]

    def region(self, places: np.ndarray, source: str) -> Region | None:
        """The fine region of some of the cells, (k,) places in `cells`; None if it is too small."""
        if self.coarse is None:
            return self.residual.region(places, source)
        lower, part = self.cells.crop(places)
        # One cell more on every side, for the fringe.
        begin = np.maximum(lower - 1, 0)
        end = np.minimum(lower + part.shape + 1, self.coarse.shape)
        wide = tuple(slice(low, high) for low, high in zip(begin, end, strict=True))
        fine = tuple(slice(2 * low, 2 * high) for low, high in zip(begin, end, strict=True))
        part = np.pad(part, np.stack([lower - begin, end - lower - part.shape], axis=1))
        mask = _refine_mask(part, self.coarse[wide], self.residual.depth[fine] > 0.0)
        residual = self.residual
        region = region_from_mask(mask, residual.lower + 2 * begin, residual.resolution, source)
        return region if region is not None and region.volume >= SMALLEST_VOLUME else None


def working_grid(residual: Residual) -> WorkingGrid:
    """The coarse grid of a big residual, else its own."""
    return WorkingGrid(residual, coarsen(residual) if residual.volume > COARSE_VOLUME else None)


def coarsen(residual: Residual) -> np.ndarray | None:
    """Depth at half the resolution, in cells of that; None if too much of the residual would get lost.

    Coarse cells begin at `residual.lower`; the box is padded to an even number of cells.
    """
    pad = [(0, size % 2) for size in residual.depth.shape]
    fine = np.pad(residual.depth, pad, constant_values=-1.0) if any(p[1] for p in pad) else residual.depth
    coarse: np.ndarray = np.zeros([size // 2 for size in fine.shape], np.float32)
    for x in (0, 1):
        for y in (0, 1):
            for z in (0, 1):
                coarse += fine[x::2, y::2, z::2]
    coarse *= np.float32(1.0 / 16.0)
    kept = _double(coarse > 0.0, residual.depth.shape) & (residual.depth > 0.0)
    return coarse if np.count_nonzero(kept) >= COARSE_SHARE * residual.volume else None


def _refine_mask(part: np.ndarray, coarse: np.ndarray, solid: np.ndarray) -> np.ndarray:
    """The fine cells of a coarse part.

    Fine cells of the solid whose coarse cell is outside of it go with the coarse parts that their cell touches.

    Args:
        part: (a, b, c) bool, coarse.
        coarse: (a, b, c) float32, above 0 in the coarse solid.
        solid: (2a or less, ...) bool, the fine solid.
    """
    around: np.ndarray = np.zeros(part.shape, bool)
    ndimage.binary_dilation(part, np.ones((3, 3, 3), bool), output=around)
    fringe = around & (coarse <= 0.0)
    return _double(part | fringe, solid.shape) & solid


def _double(mask: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    fine = mask.repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2)
    return fine[: shape[0], : shape[1], : shape[2]]
