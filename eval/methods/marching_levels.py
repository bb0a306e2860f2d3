"""Levels that march outward through a solid, deepest parts first, and the superquadrics found at each.

At each level every connected region of cells at least so deep is fitted by one superquadric (see `marching_fit`). What
it holds is set to outside; what is left of the level is looked at again; then the next level follows.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import warp as wp

from ...kernels.field.evaluate import evaluate_primitives
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.rows import ROTATION, ROW, SHAPES, TRANSLATION
from .marching_fit import FAMILY, MarchingFitConfig, fit_level
from .marching_regions import regions_below


@dataclass(frozen=True, kw_only=True)
class MarchingConfig:
    """Options of the marching levels."""

    ratio: float = 0.6
    """Each level over the one before."""
    last_level: float = 0.5
    """Cells: levels stop here."""
    smallest: int = 12
    """Cells that a region must have, and that a superquadric must explain anew."""
    repeats: int = 3
    """Times that a level is looked at for what it still holds."""
    most: int = 60
    """Regions of one level."""
    purity: float = 2.0
    """Cells that a superquadric explains anew over those that it holds outside the target, at least."""
    fit: MarchingFitConfig = field(default_factory=MarchingFitConfig)


def march(
    grid: np.ndarray, device: wp.Device, config: MarchingConfig | None = None, seed: int = 0
) -> np.ndarray:
    """Superquadrics that together fill a solid.

    Args:
        grid: (n, n, n) float32 signed distance at the cell centres of [-1, 1]^3, normalised, negative inside.
        device: where to fit.
        config: how.
        seed: equal seeds give equal results.

    Returns:
        Rows (count, ROW) float32 of the family superquadric, hard union, in the order in which they were found.
    """
    config = config or MarchingConfig()
    rng = np.random.default_rng(seed)
    depth = np.maximum(grid * np.float32(-0.5 * len(grid)), 0.0)
    explained = np.zeros(grid.shape, bool)
    found: list[np.ndarray] = []
    level = float(depth.max())
    while level >= config.last_level:
        level = max(level * config.ratio, config.last_level)
        for _ in range(config.repeats):
            regions = regions_below(depth, level, config.smallest, config.most)
            if not regions:
                break
            rows = fit_level(regions, grid, explained, config.fit, device, rng)
            taken = [row for row in rows if _take(row, grid, depth, explained, config, device)]
            found += taken
            if not taken:
                break
        if level <= config.last_level:
            break
    return np.stack(found) if found else np.zeros((0, ROW), np.float32)


def _take(
    row: np.ndarray,
    grid: np.ndarray,
    depth: np.ndarray,
    explained: np.ndarray,
    config: MarchingConfig,
    device: wp.Device,
) -> bool:
    """Mark what a superquadric holds as explained, and as outside; False, and nothing done, if it brings too little."""
    box = _cells_around(row, len(grid))
    shape = tuple(edge.stop - edge.start for edge in box)
    if min(shape) <= 0:
        return False
    axes = [(np.arange(edge.start, edge.stop) + 0.5) * (2.0 / len(grid)) - 1.0 for edge in box]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)
    held = evaluate_primitives(PrimitiveSet(row[None], [FAMILY], device), points)[0].reshape(shape) < 0.0
    inside = grid[box] < 0.0
    gained = np.count_nonzero(held & inside & ~explained[box])
    wrong = np.count_nonzero(held & ~inside)
    if gained < config.smallest or gained < config.purity * wrong:
        return False
    explained[box] |= held & inside
    depth[box][held] = 0.0
    return True


def _cells_around(row: np.ndarray, resolution: int) -> tuple[slice, slice, slice]:
    """The cells of a superquadric's bounding box."""
    w, x, y, z = row[ROTATION : ROTATION + 4].astype(np.float64)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    reach = np.abs(turn) @ (0.5 * row[SHAPES : SHAPES + 3].astype(np.float64))
    centre = row[TRANSLATION : TRANSLATION + 3].astype(np.float64)
    low = np.clip(np.floor((centre - reach + 1.0) * 0.5 * resolution), 0, resolution).astype(int)
    high = np.clip(np.ceil((centre + reach + 1.0) * 0.5 * resolution), 0, resolution).astype(int)
    return slice(low[0], high[0]), slice(low[1], high[1]), slice(low[2], high[2])
