"""Superquadrics fitted to signed distances around regions, robust to what other superquadrics will explain.

Residual of a cell: occupancy of the superquadric minus occupancy of the target, both the logistic function of a signed
distance. That is a smooth truncation: beyond two or three cells from a surface it is flat, so that it does the work of
a truncated distance, and the normal equations that the rest of the package has serve here too. The superquadric's
distance is its radial one.

A cell of the target that the superquadric leaves out is no error if another one will hold it. Each such cell is
therefore either explained by this superquadric up to noise (a normal distribution) or belongs to another one (a
uniform one): its weight is the probability of the former, computed anew between steps, as is the noise, as in
expectation maximisation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ...fitter.refine.levenberg import levenberg
from ...kernels.field.evaluate import evaluate_primitives
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.refine.point_batches import point_batches, shared_points
from .marching_regions import LevelRegion, region_candidates

FAMILY = "superquadric"


@dataclass(frozen=True, kw_only=True)
class MarchingFitConfig:
    """Options of the fit of regions."""

    points: int = 1536
    """Cells that a superquadric is fitted to."""
    near_share: float = 0.6
    """Share of these within NEAR cells of the target's surface."""
    padding: float = 6.0
    """Cells around a region's reach that may belong to its superquadric."""
    search_steps: int = 4
    """Levenberg steps of every candidate."""
    passes: int = 5
    """Times that weights are computed anew."""
    steps: int = 4
    """Levenberg steps of each pass."""
    betas: tuple[float, float] = (0.5, 4.0)
    """Sharpness of the occupancy per cell, in the search and in the last pass."""
    wrong: float = 3.0
    """Price of a cell outside the target, in cells explained, when candidates are compared."""
    uniform: float = 0.8
    """Prior probability that a cell of the target belongs to another superquadric."""
    explained: float = 0.0
    """Weight of cells of the target that an earlier superquadric holds: to hold them again is neither good nor bad."""
    noise: tuple[float, float] = (0.35, 0.05)
    """Standard deviation of the residual at the start, and its least value."""


NEAR = 2.5
"""Cells from the surface up to which a cell counts as near it."""


@dataclass(frozen=True)
class RegionCells:
    """Cells around a region."""

    points: np.ndarray
    """(n, 3) float32, normalised frame."""
    target: np.ndarray
    """(n,) float32 signed distance of the target, normalised."""
    weight: np.ndarray
    """(n,) float32, 1, or less where an earlier superquadric is."""
    volume: np.ndarray
    """(n,) float32, cells of the grid that each stands for."""


def fit_level(
    regions: list[LevelRegion],
    grid: np.ndarray,
    explained: np.ndarray,
    config: MarchingFitConfig,
    device: wp.Device,
    rng: np.random.Generator,
) -> np.ndarray:
    """One superquadric for every region, all fitted at once.

    Args:
        regions: at least one.
        grid: (n, n, n) signed distance of the target at the cell centres of [-1, 1]^3, normalised.
        explained: (n, n, n) bool, cells that earlier superquadrics hold.
        config: how.
        device: where to fit.
        rng: chooses cells.

    Returns:
        Rows (len(regions), ROW) float32.
    """
    cells = [_sample_cells(region, grid, explained, config, rng) for region in regions]
    starts = [region_candidates(region, len(grid)) for region in regions]
    rows, readers = np.concatenate(starts), np.repeat(np.arange(len(regions)), [len(s) for s in starts])
    rows = _search(rows, readers, cells, len(grid), config, device)
    rows = _settle(rows, readers, cells, len(grid), config, device)
    score = _scores(rows, readers, cells, config, device)
    # Sorted by region, then score: the first of each region is its best.
    order = np.lexsort((-score, readers))
    return rows[order[np.searchsorted(readers[order], np.arange(len(regions)))]]


def _sample_cells(
    region: LevelRegion,
    grid: np.ndarray,
    explained: np.ndarray,
    config: MarchingFitConfig,
    rng: np.random.Generator,
) -> RegionCells:
    """Cells around a region that its superquadric is compared with, most of them near the target's surface."""
    n = len(grid)
    margin = int(np.ceil(1.5 * region.depth + config.padding))
    low = np.maximum(region.lower - margin, 0)
    high = np.minimum(region.lower + region.mask.shape + margin, n)
    box = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
    near = np.abs(grid[box]).reshape(-1) < NEAR * 2.0 / n
    close, rest = np.flatnonzero(near), np.flatnonzero(~near)
    picked = [_choose(close, int(config.near_share * config.points), rng)]
    picked.append(_choose(rest, config.points - len(picked[0]), rng))
    chosen = np.concatenate(picked)
    volume = np.repeat(
        [len(close) / max(1, len(picked[0])), len(rest) / max(1, len(picked[1]))], [len(p) for p in picked]
    )
    shape = tuple(int(size) for size in high - low)
    index = np.stack(np.unravel_index(chosen, shape), axis=1) + low
    points = ((index + 0.5) * (2.0 / n) - 1.0).astype(np.float32)
    taken = explained[box].reshape(-1)[chosen]
    weight = np.where(taken, np.float32(config.explained), np.float32(1.0))
    return RegionCells(points, grid[box].reshape(-1)[chosen], weight, volume)


def _choose(cells: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """At most `count` of the cells, one at random from each of as many equal runs."""
    if len(cells) <= count:
        return cells
    places = (np.arange(count) + rng.uniform(size=count)) * (len(cells) / count)
    return cells[np.minimum(places.astype(np.int64), len(cells) - 1)]


def _search(
    rows: np.ndarray,
    readers: np.ndarray,
    cells: list[RegionCells],
    resolution: int,
    config: MarchingFitConfig,
    device: wp.Device,
) -> np.ndarray:
    """All candidates of all regions, fitted with blunt occupancies."""
    sizes = [len(cell.points) for cell in cells]
    points = shared_points(
        np.concatenate([cell.points for cell in cells]),
        np.repeat(np.arange(len(cells)), sizes),
        readers,
        np.concatenate([cell.target for cell in cells]),
        # Before anything is known of a candidate, cells that it leaves out count for less.
        np.concatenate([np.where(cell.target < 0.0, 0.5, 1.0) * cell.weight for cell in cells]),
        device=device,
    )
    betas = np.full(len(rows), config.betas[0] * 0.5 * resolution)
    return levenberg(rows, [FAMILY] * len(rows), points, betas, config.search_steps, device)[0]


def _settle(
    rows: np.ndarray,
    readers: np.ndarray,
    cells: list[RegionCells],
    resolution: int,
    config: MarchingFitConfig,
    device: wp.Device,
) -> np.ndarray:
    """Expectation maximisation: weights from residuals, a few Levenberg steps, ever sharper occupancies."""
    count = len(rows)
    owners = np.repeat(np.arange(count), [len(cells[k].points) for k in readers])
    points = np.concatenate([cells[k].points for k in readers])
    target = np.concatenate([cells[k].target for k in readers])
    given = np.concatenate([cells[k].weight for k in readers])
    noise = np.full(count, config.noise[0])
    for beta in np.geomspace(*config.betas, config.passes) * 0.5 * resolution:
        field = _own_values(rows, readers, cells, device)
        residual = _occupancy(field, beta) - _occupancy(target, beta)
        weight = given * _belongs(residual, target, noise[owners], config.uniform)
        squares = np.bincount(owners, weight * residual**2, count)
        total = np.bincount(owners, weight, count)
        noise = np.maximum(np.sqrt(squares / np.maximum(total, 1e-9)), config.noise[1])
        owned = point_batches(points, owners, count, target, np.sqrt(weight), device=device)
        rows, _ = levenberg(rows, [FAMILY] * count, owned, np.full(count, beta), config.steps, device)
    return rows


def _scores(
    rows: np.ndarray,
    readers: np.ndarray,
    cells: list[RegionCells],
    config: MarchingFitConfig,
    device: wp.Device,
) -> np.ndarray:
    """Cells that each row explains anew, less `wrong` times those that it holds outside the target."""
    worth = [cell.weight * cell.volume * np.where(cell.target < 0.0, 1.0, -config.wrong) for cell in cells]
    owners = np.repeat(np.arange(len(rows)), [len(cells[k].points) for k in readers])
    held = _own_values(rows, readers, cells, device) < 0.0
    return np.bincount(owners, held * np.concatenate([worth[k] for k in readers]), len(rows))


def _own_values(
    rows: np.ndarray, readers: np.ndarray, cells: list[RegionCells], device: wp.Device
) -> np.ndarray:
    """Distances of each row alone at the cells of its region, one row after the other."""
    edges = np.searchsorted(readers, np.arange(len(cells) + 1))
    values = []
    for cell, begin, end in zip(cells, edges, edges[1:], strict=False):
        primitives = PrimitiveSet(rows[begin:end], [FAMILY] * (end - begin), device)
        values.append(evaluate_primitives(primitives, cell.points).reshape(-1))
    return np.concatenate(values)


def _belongs(residual: np.ndarray, target: np.ndarray, noise: np.ndarray, prior: float) -> np.ndarray:
    """Probability (n,) that a cell is this superquadric's; 1 outside the target and where it holds the cell."""
    normal = (1.0 - prior) * np.exp(-0.5 * (residual / noise) ** 2) / (np.sqrt(2.0 * np.pi) * noise)
    share = normal / (normal + prior)
    return np.where((target < 0.0) & (residual < 0.0), share, 1.0)


def _occupancy(distance: np.ndarray, beta: float) -> np.ndarray:
    """sigmoid(-beta distance)."""
    return 1.0 / (1.0 + np.exp(np.clip(beta * distance, -60.0, 60.0)))
