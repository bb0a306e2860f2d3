"""What the assembly does not explain yet, without the noise around fitted surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..kernels.cells import CellSet
from ..kernels.morphology import largest_components
from .region import Region, true_box

NOISE_SHELL = 1.5
"""Cells between the target's surface and the assembly's up to which what lies between them is noise. Every fitted
surface leaves such a shell, about a cell thick; refinement mends it, new primitives do not."""

SMALLEST_VOLUME = 12
"""Cells of the smallest region that is worth a primitive."""


@dataclass(frozen=True)
class Residual:
    """Depth of the cells that are inside the target and outside the assembly, on the box that holds them."""

    depth: np.ndarray
    """(a, b, c) float32, contiguous: distance in cells to what is not residual; 0 or less outside of it."""
    lower: np.ndarray
    """(3,) int32, the cell at [0, 0, 0] of `depth`."""
    resolution: int
    """Cells along a side of the whole grid."""
    volume: int
    """Number of residual cells."""

    @cached_property
    def cells(self) -> CellSet:
        """The residual cells."""
        return CellSet(self.depth > 0.0)

    def region(self, places: np.ndarray, source: str) -> Region | None:
        """The region of some of the cells, (k,) places in `cells`; None if it is too small to be worth a primitive."""
        if len(places) < SMALLEST_VOLUME:
            return None
        lower, mask = self.cells.crop(places)
        return Region(self.lower + lower, mask, self.resolution, source)


def find_residual(grid: np.ndarray, explained: np.ndarray | None = None) -> Residual | None:
    """The residual of a target and an assembly.

    A cell counts where it is inside the target, outside the assembly, and the two surfaces are more than NOISE_SHELL
    cells apart as measured through it: its distance to one plus its distance to the other. In a shell of noise that
    sum is the shell's thickness wherever the cell lies in it. In a part of the target that is itself thinner than a
    cell, the assembly is far away, and the part counts in spite of its small depth.

    Args:
        grid: (n, n, n) float32, signed distance of the target at the cell centres of [-1, 1]^3, negative inside.
        explained: the same of the assembly, None if there is none yet.

    Returns:
        The residual on the box that holds it; None if there is none.
    """
    resolution = len(grid)
    box = true_box(grid < 0.0)
    if box is None:
        return None
    cells = 0.5 * resolution
    depth = grid[box] * np.float32(-cells)
    lower = np.array([edge.start for edge in box], np.int32)
    if explained is not None:
        # An empty assembly is 1e30 away; nothing in the cube is further than 4.
        away = np.minimum(explained[box], 4.0) * np.float32(cells)
        noise = (depth + away) <= NOISE_SHELL
        depth = np.minimum(depth, away)
        depth[noise] = np.minimum(depth[noise], 0.0)
        inner = true_box(depth > 0.0)
        if inner is None:
            return None
        depth = depth[inner]
        lower = lower + np.array([edge.start for edge in inner], np.int32)
    depth = np.ascontiguousarray(depth, np.float32)
    return Residual(depth, lower, resolution, int(np.count_nonzero(depth > 0.0)))


def residual_components(residual: Residual, smallest: int = SMALLEST_VOLUME, most: int = 64) -> list[Region]:
    """The connected parts (26 neighbours) of at least `smallest` cells, largest first, at most `most` of them."""
    cells = residual.cells
    key = np.zeros(len(cells), np.int32)
    parts = largest_components(cells, cells.all_places(), key, smallest, most, full=True)
    regions = [residual.region(part, "component") for part in parts]
    return [region for region in regions if region is not None]
