"""Residual: what the assembly does not explain yet, without the noise around fitted surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..kernels.grid.morphology import largest_components
from ..kernels.grid.sparse_cells import CellSet
from .region import Region
from .target_cells import TargetCells

NOISE_SHELL = 1.5
"""Cells between the target's surface and the assembly's up to which what lies between them is noise. Every fitted
surface leaves such a shell, about a cell thick; refinement mends it, new primitives do not."""

SMALLEST_VOLUME = 12
"""Cells of the smallest region that is worth a primitive."""


@dataclass(frozen=True)
class Residual:
    """The cells that are inside the target and outside the assembly, and the box that holds them."""

    target: TargetCells
    explained: np.ndarray | None
    """(n, n, n) float32, signed distance of the assembly at the target's cells; None if there is none."""
    lower: np.ndarray
    """(3,) int32, first cell of the box."""
    cells: CellSet
    """On the box."""
    depths: np.ndarray
    """(m,) float32, distance of each to what is not residual, in cells."""

    @property
    def resolution(self) -> int:
        """Cells along a side of the whole grid."""
        return self.target.resolution

    @property
    def volume(self) -> int:
        """Number of residual cells."""
        return len(self.cells)

    @cached_property
    def depth(self) -> np.ndarray:
        """(a, b, c) float32, contiguous: `depths` on the whole box, 0 or less outside the residual."""
        box = tuple(slice(low, low + size) for low, size in zip(self.lower, self.cells.shape, strict=True))
        depth = self.target.grid[box] * np.float32(-0.5 * self.resolution)
        if self.explained is not None:
            depth = _unexplained_depth(depth, self.explained[box], self.resolution)
        return np.ascontiguousarray(depth, np.float32)

    def region(self, places: np.ndarray, source: str) -> Region | None:
        """The region of some of the cells, (k,) places in `cells`; None if it is too small to be worth a primitive."""
        if len(places) < SMALLEST_VOLUME:
            return None
        lower, mask = self.cells.crop(places)
        return Region(self.lower + lower, mask, self.resolution, source)


def find_residual(target: TargetCells, explained: np.ndarray | None = None) -> Residual | None:
    """The residual of a target and an assembly.

    A cell counts where it is inside the target, outside the assembly, and the two surfaces are more than NOISE_SHELL
    cells apart as measured through it: its distance to one plus its distance to the other. In a shell of noise that
    sum is the shell's thickness wherever the cell lies in it. In a part of the target that is itself thinner than a
    cell, the assembly is far away, and the part counts in spite of its small depth.

    Args:
        target: its cells.
        explained: (n, n, n) float32, signed distance of the assembly at the cell centres, None if there is none yet.

    Returns:
        The residual on the box that holds it; None if there is none.
    """
    cells, lower, depth = target.cells, target.lower, target.depth
    if explained is not None:
        depth = _unexplained_depth(depth, explained.reshape(-1)[target.flat], target.resolution)
        left = np.flatnonzero(depth > 0.0)
        depth, index = depth[left], cells.at(left)
        if len(left):
            begin = index.min(axis=1)
            lower = lower + begin
            cells = CellSet(index - begin[:, None], tuple(index.max(axis=1) + 1 - begin))
    return Residual(target, explained, lower, cells, depth) if len(depth) else None


def _unexplained_depth(depth: np.ndarray, away: np.ndarray, resolution: int) -> np.ndarray:
    """Depth of cells as residual, from their depth in the target, in cells, and their distance from the assembly."""
    # An empty assembly is 1e30 away; nothing in the cube is further than 4.
    away = np.minimum(away, 4.0) * np.float32(0.5 * resolution)
    noise = (depth + away) <= NOISE_SHELL
    depth = np.minimum(depth, away)
    depth[noise] = np.minimum(depth[noise], 0.0)
    return depth


def residual_components(residual: Residual, smallest: int = SMALLEST_VOLUME, most: int = 64) -> list[Region]:
    """The connected parts (26 neighbours) of at least `smallest` cells, largest first, at most `most` of them."""
    cells = residual.cells
    key = np.zeros(len(cells), np.int32)
    parts = largest_components(cells, cells.all_places(), key, smallest, most, full=True)
    regions = [residual.region(part, "component") for part in parts]
    return [region for region in regions if region is not None]
