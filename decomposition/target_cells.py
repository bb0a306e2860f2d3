"""The cells inside a target, listed once for a whole fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kernels.grid.sparse_cells import CellSet, cells_of
from .region import true_box


@dataclass(frozen=True)
class TargetCells:
    """The cells inside a target."""

    grid: np.ndarray
    """(n, n, n) float32, signed distance of the target at the cell centres of [-1, 1]^3, negative inside."""
    lower: np.ndarray
    """(3,) int32, first cell of the box that holds them."""
    cells: CellSet
    """On that box."""
    flat: np.ndarray
    """(m,) indices into the flattened grid."""
    depth: np.ndarray
    """(m,) float32, distance to the target's surface, in cells."""

    @property
    def resolution(self) -> int:
        """Cells along a side of the grid."""
        return len(self.grid)


def target_cells(grid: np.ndarray) -> TargetCells:
    """The cells inside a target, from its signed distances (n, n, n) float32."""
    inside = grid < 0.0
    box = true_box(inside) or (slice(0, 0),) * 3
    lower = np.array([edge.start for edge in box], np.int32)
    cells = cells_of(inside[box])
    flat = np.asarray(np.ravel_multi_index(tuple(cells.index + lower[:, None]), grid.shape))
    depth = grid.reshape(-1)[flat].astype(np.float32) * np.float32(-0.5 * len(grid))
    return TargetCells(grid, lower, cells, flat, depth)
