"""The signed distance of a solid at the cell centres of [-1, 1]^3."""

from __future__ import annotations

import numpy as np

from ..kernels.mesh.inside_grid import classify_cells
from ..kernels.mesh.mesh_grid import unsigned_distance_grid
from .solid_query import CELL_RESOLUTION, SolidQuery


def distance_grid(query: SolidQuery, resolution: int) -> np.ndarray:
    """Signed distance on `resolution`^3 cells of [-1, 1]^3, normalised, negative inside.

    Exact within two cells of a surface, beyond an upper bound that is at most a cell too long; the sign is exact.

    Args:
        query: the solid.
        resolution: cells along a side, 2 to 1024.

    Returns:
        (n, n, n) float32; cell [i, j, k] is centred at (2 [i, j, k] + 1) / n - 1.
    """
    shape = (resolution,) * 3
    distance = np.full(shape, np.inf, np.float32)
    if query.winding is not None and query.boundary is not None:
        known = query.winding.inside
        if resolution != CELL_RESOLUTION:
            known = classify_cells(query.winding.mesh, resolution)[0]
        distance = unsigned_distance_grid(query.boundary, resolution).numpy()
        distance[np.asarray(known.numpy(), bool)] *= -1.0
    if query.sheets is not None:
        sheet = unsigned_distance_grid(query.sheets, resolution).numpy()
        np.minimum(distance, sheet - np.float32(0.5 * query.solid.thickness), out=distance)
    return distance


def grid_volume(grid: np.ndarray) -> float:
    """Volume of a solid in cubed normalised units, from its signed distances (n, n, n) at the cells of [-1, 1]^3."""
    spacing = 2.0 / len(grid)
    # A cell at the surface counts by the share of it that is inside, as its distance tells.
    return float(np.clip(0.5 - grid / spacing, 0.0, 1.0).sum(dtype=np.float64)) * spacing**3


def intersection_over_union(a: np.ndarray, b: np.ndarray) -> float:
    """IoU of two solids, boolean arrays of one shape that say where each is; 0 where both are empty."""
    return float(np.count_nonzero(a & b) / max(1, np.count_nonzero(a | b)))
