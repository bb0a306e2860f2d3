"""Solids on grids, and regions as masks."""

from __future__ import annotations

from typing import Any

import numpy as np

from resfit.decomposition.propose import find_parts, largest_parts
from resfit.decomposition.region import Region
from resfit.decomposition.target_cells import target_cells


def cells(resolution: int = 64) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates x, y, z of the cell centres of [-1, 1]^3, each (n, n, n)."""
    line = (np.arange(resolution) + 0.5) * (2.0 / resolution) - 1.0
    x, y, z = np.meshgrid(line, line, line, indexing="ij")
    return x, y, z


def ball(at: tuple[float, float, float], radius: float, resolution: int = 64) -> np.ndarray:
    x, y, z = cells(resolution)
    return np.sqrt((x - at[0]) ** 2 + (y - at[1]) ** 2 + (z - at[2]) ** 2) - radius


def box(
    low: tuple[float, float, float], high: tuple[float, float, float], resolution: int = 64
) -> np.ndarray:
    q = [np.maximum(a - side, b - a) * 1.0 for a, b, side in zip(cells(resolution), low, high, strict=True)]
    return np.sqrt(sum(np.maximum(side, 0.0) ** 2 for side in q)) + np.minimum(np.maximum.reduce(q), 0.0)


def grid(*solids: np.ndarray) -> np.ndarray:
    """Union of signed distances, float32."""
    return np.minimum.reduce(solids).astype(np.float32)


def paint(region: Region) -> np.ndarray:
    full = np.zeros([region.resolution] * 3, bool)
    low, high = region.lower, region.lower + region.mask.shape
    full[low[0] : high[0], low[1] : high[1], low[2] : high[2]] = region.mask
    return full


def share(a: np.ndarray, b: np.ndarray) -> float:
    return float((a & b).sum() / (a | b).sum())


def propose_regions(
    solid: np.ndarray, explained: np.ndarray | None = None, *, most: int = 64, **options: Any
) -> list[Region]:
    """What a round would fit primitives to, of a grid (n, n, n) of signed distances."""
    return largest_parts(find_parts(target_cells(solid), explained, most=most, **options), most)
