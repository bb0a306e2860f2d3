"""Candidates of a round: every region fitted from many starts in batched launches, the best few kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ...decomposition.region import Region
from ...kernels.primitives import family as primitive_family
from ...kernels.primitives.swept_solids import box_solids
from ...kernels.refine.point_batches import shared_points
from ...kernels.rotation import quaternion_of
from ...kernels.rows import ROTATION, SHAPE, SHAPES, TRANSLATION, empty_rows
from ..presets import ProposeConfig
from ..refine.levenberg import levenberg
from .initial_primitives import all_starts
from .region_points import RegionPoints, sample_regions

SHARPNESS_RANGE = (8.0, 400.0)


@dataclass(frozen=True)
class Candidates:
    """Fitted primitives of one family, in no particular order."""

    rows: np.ndarray
    """(count, ROW) float32."""
    region: np.ndarray
    """(count,) the region each was fitted to."""
    kind: list[str]
    """What each started as."""

    def __len__(self) -> int:
        return len(self.rows)


def fit_regions(
    regions: list[Region],
    grid: np.ndarray,
    family: str,
    config: ProposeConfig,
    seed: int,
    device: wp.Device,
) -> Candidates:
    """Fit all regions from all their starts and keep each region's best.

    In stages, each with fewer starts than the one before. Starts of a region share its points.

    Args:
        regions: parts of the target to fill, at least one.
        grid: (n, n, n) signed distance of the target at the cell centres of [-1, 1]^3.
        family: of the candidates.
        config: the stages.
        seed: of the sample points.
        device: where to fit.
    """
    rows, region, kinds = all_starts(regions, family)
    samples = sample_regions(regions, grid, config.points, seed)
    kind = np.array(kinds)
    for stage in config.stages:
        points = samples.half() if stage.half else samples
        rows, cost = _fit_stage(rows, region, points, family, stage.sharpness, stage.iterations, device)
        best = _best_of_each(region, cost, stage.keep)
        rows, region, kind = rows[best], region[best], kind[best]
    return Candidates(rows, region, kind.tolist())


def _fit_stage(
    rows: np.ndarray,
    region: np.ndarray,
    samples: RegionPoints,
    family: str,
    sharpness: float,
    iterations: int,
    device: wp.Device,
) -> tuple[np.ndarray, np.ndarray]:
    points = shared_points(
        samples.points, samples.region, region, samples.distance, samples.weight, device=device
    )
    betas = np.clip(sharpness / samples.scale, *SHARPNESS_RANGE)[region]
    return levenberg(rows, [family] * len(rows), points, betas, iterations, device)


def _best_of_each(region: np.ndarray, cost: np.ndarray, keep: int) -> np.ndarray:
    """Indices of the `keep` cheapest of each region, cheapest first."""
    order = np.lexsort((cost, region))
    sorted_region = region[order]
    first = np.searchsorted(sorted_region, sorted_region)
    return order[np.arange(len(order)) - first < keep]


def seed_regions(regions: list[Region], family: str) -> Candidates:
    """One unfitted seed a region, as the paper has it: principal axes, swept along the most cylindrical one.

    The cylindricity of an axis is how equal the extents across it are.
    """
    rows = np.stack([_seed(region, family) for region in regions])
    return Candidates(rows, np.arange(len(regions)), ["seed"] * len(regions))


def _seed(region: Region, name: str) -> np.ndarray:
    points = region.centres().astype(np.float64)
    centre = points.mean(0)
    _, axes = np.linalg.eigh(np.cov((points - centre).T) + 1e-9 * np.eye(3))
    low, high = np.quantile((points - centre) @ axes, [0.01, 0.99], axis=0)
    extent = high - low + 2.0 / region.resolution
    across = [np.delete(extent, axis) for axis in range(3)]
    sweep = int(np.argmax([pair.min() / pair.max() for pair in across]))
    order = [(sweep + 1) % 3, (sweep + 2) % 3, sweep]
    frame = axes[:, order]
    if np.linalg.det(frame) < 0:
        frame[:, 0] *= -1.0
    row = empty_rows(1)[0]
    row[TRANSLATION : TRANSLATION + 3] = centre + axes @ ((low + high) / 2)
    row[ROTATION : ROTATION + 4] = quaternion_of(frame)
    entry = primitive_family(name)
    solid = box_solids(np.maximum(extent[order], 0.02)[None], roundness=0.5)
    row[SHAPES : SHAPES + SHAPE] = entry.starts(entry, solid)[0][0]
    return row
