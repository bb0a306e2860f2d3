"""Oriented boxes of regions: axes to sweep along, extents, holes, tapers and arcs, from their points.

Everything takes the points of R regions at once, (R, m, 3), as many of each, in the normalised frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

TAIL = 0.005
"""Share of the points beyond either end that extents leave out: a few stray cells must not stretch a start."""

SLANTED = 0.2
"""Share of the half cell that a slanted extent lacks. Along an axis of the grid the outermost centres are half a cell
short of the faces; along any other some centre is close to them."""

TURNS = 15
"""Angles in a quarter turn at which the box round a region is tried."""

ARC_BINS = 36
"""Directions round a circle in which points are looked for, to find where an arc ends."""

CYCLES = np.array([[1, 2, 0], [2, 0, 1], [0, 1, 2]])
"""Axes in the order (profile x, profile y, sweep), for each of the three as the sweep axis."""


@dataclass(frozen=True)
class Placements:
    """Boxes that hold regions, swept along z: for each of R regions one for each of three sweep axes."""

    axes: np.ndarray
    """(R, 3, 3, 3): [region, sweep, :, k] is the local axis k in the normalised frame; right-handed."""
    centre: np.ndarray
    """(R, 3, 3) of the box, normalised frame."""
    extent: np.ndarray
    """(R, 3, 3) full extents along the local axes."""
    hole: np.ndarray
    """(R, 3) share of the profile's inset radius, from its middle, that holds no points; 0 for a solid one."""
    taper: np.ndarray
    """(R, 3) width of the profile at the upper end relative to the lower end; 1 for a prism, infinite for a tip
    below."""


@dataclass(frozen=True)
class Arcs:
    """Circles through regions as seen along three axes: what the points look like round them."""

    axes: np.ndarray
    """(R, 3, 3, 3) as in `Placements`: seen along y, the arc bulges towards -x, its chord is along z."""
    centre: np.ndarray
    """(R, 3, 3) of the circle, in the middle of the points' extent along y."""
    radius: np.ndarray
    """(R, 3) of the circle through the middle of the material."""
    half_angle: np.ndarray
    """(R, 3) half of the angle that the points fill, 0 to pi."""
    width: np.ndarray
    """(R, 3) thickness along the radius."""
    height: np.ndarray
    """(R, 3) thickness along y."""


def principal_axes(points: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Right-handed axes (R, 3, 3), in columns, in order of falling spread, from covariances (R, 3, 3).

    Spreads that are alike leave axes free to turn in their plane: there they are turned to the smallest rectangle.
    """
    centred = points - points.mean(axis=1, keepdims=True)
    values, vectors = np.linalg.eigh(covariance)
    values, axes = np.maximum(values[:, ::-1], 1e-12), vectors[:, :, ::-1].copy()
    # The sign of an eigenvector is arbitrary: its largest component is made positive.
    largest = np.take_along_axis(axes, np.abs(axes).argmax(axis=1)[:, None, :], axis=1)
    axes *= np.where(largest < 0.0, -1.0, 1.0)
    axes[:, :, 2] *= np.where(np.linalg.det(axes) < 0.0, -1.0, 1.0)[:, None]
    # A rod is sure of its long axis, a plate of its normal.
    sure = np.where(values[:, 0] * values[:, 2] > values[:, 1] ** 2, 0, 2)
    plane = np.stack([(sure + 1) % 3, (sure + 2) % 3], axis=1)
    flat = centred @ np.take_along_axis(axes, plane[:, None, :], axis=2)
    angles = np.arange(TURNS) * (0.5 * np.pi / TURNS)
    one, two = np.ascontiguousarray(np.moveaxis(flat, 2, 0))
    area = np.empty((len(points), TURNS))
    # Turn by turn, so that a turn's coordinates stay in the cache.
    for turn, (cosine, sine) in enumerate(zip(np.cos(angles), np.sin(angles), strict=True)):
        along, across = one * cosine + two * sine, two * cosine - one * sine
        area[:, turn] = np.ptp(along, axis=1) * np.ptp(across, axis=1)
    area[:, 0] *= 0.98
    chosen = angles[area.argmin(axis=1)]
    first, second = (np.take_along_axis(axes, plane[:, None, k : k + 1], axis=2)[:, :, 0] for k in (0, 1))
    cosine, sine = np.cos(chosen)[:, None], np.sin(chosen)[:, None]
    rows = np.arange(len(axes))
    axes[rows, :, plane[:, 0]] = cosine * first + sine * second
    axes[rows, :, plane[:, 1]] = cosine * second - sine * first
    return axes


def missing_margin(axes: np.ndarray, half_cell: np.ndarray) -> np.ndarray:
    """Margin that extents of cell centres along axes (R, 3, k) lack either side, (R, k); half_cell (R,)."""
    aligned = np.abs(axes).max(axis=1) > 0.9999
    return half_cell[:, None] * np.where(aligned, 1.0, SLANTED)


def robust_bounds(values: np.ndarray, margin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds (R, k) of values (R, m, k) along their points, without stray ones, widened by margin (R, k)."""
    count = values.shape[1]
    skip = int(TAIL * count)
    # Partitions run along memory.
    ordered = np.partition(np.ascontiguousarray(np.swapaxes(values, 1, 2)), (skip, count - 1 - skip), axis=2)
    return ordered[:, :, skip] - margin, ordered[:, :, count - 1 - skip] + margin


def place(points: np.ndarray, axes: np.ndarray, half_cell: np.ndarray) -> Placements:
    """The boxes of regions along `axes` (R, 3, 3), for each of the three as the sweep axis; half_cell (R,)."""
    local = points @ axes
    low, high = robust_bounds(local, missing_margin(axes, half_cell))
    middle, extent = 0.5 * (low + high), np.maximum(high - low, half_cell[:, None])
    # Coordinate by coordinate, (3, R, m): everything below then runs along memory.
    local = np.moveaxis(local, 2, 0) - middle.T[:, :, None]
    centre = (axes @ middle[:, :, None])[:, :, 0]
    sizes = extent[:, CYCLES]
    hole = np.stack([_hole_share(local[c], extent[:, c], half_cell) for c in CYCLES], axis=1)
    taper = np.stack([_taper_ratio(local[c], extent[:, c]) for c in CYCLES], axis=1)
    turned = np.stack([axes[:, :, c] for c in CYCLES], axis=1)
    return Placements(turned, np.repeat(centre[:, None, :], 3, axis=1), sizes, hole, taper)


def _hole_share(local: np.ndarray, size: np.ndarray, half_cell: np.ndarray) -> np.ndarray:
    # Distance of a point from the medial axis of a fully rounded profile, as a share of the inset radius.
    inset = 0.5 * np.minimum(size[:, 0], size[:, 1])
    core = np.maximum(np.abs(local[:2]) - (0.5 * size[:, :2] - inset[:, None]).T[:, :, None], 0.0)
    square = core[0] * core[0] + core[1] * core[1]
    skip = int(2 * TAIL * square.shape[1])
    nearest = np.sqrt(np.partition(square, skip, axis=1)[:, skip])
    return np.clip((nearest - 0.5 * half_cell) / inset, 0.0, 0.95)


def _taper_ratio(local: np.ndarray, size: np.ndarray) -> np.ndarray:
    # Spread across the axis in the lowest and highest third, carried on from their middles to the ends.
    spread = np.abs(local[0]) + np.abs(local[1])
    height = local[2] / size[:, 2:]
    upper, lower = height > 1.0 / 6.0, height < -1.0 / 6.0
    top = (spread * upper).sum(axis=1) / np.maximum(upper.sum(axis=1), 1)
    bottom = (spread * lower).sum(axis=1) / np.maximum(lower.sum(axis=1), 1)
    slope = np.clip(1.5 * (top - bottom) / np.maximum(top + bottom, 1e-9), -1.0, 1.0 - 1e-9)
    return (1.0 + slope) / (1.0 - slope)


def find_arcs(points: np.ndarray, axes: np.ndarray, half_cell: np.ndarray) -> Arcs:
    """The circles through regions as seen along each of `axes` (R, 3, 3); half_cell (R,)."""
    found = [_arcs_in_plane(points, axes[:, :, [(y + 2) % 3, y, (y + 1) % 3]], half_cell) for y in range(3)]
    return Arcs(*(np.stack(values, axis=1) for values in zip(*found, strict=True)))


def _arcs_in_plane(points: np.ndarray, axes: np.ndarray, half_cell: np.ndarray) -> tuple[np.ndarray, ...]:
    """The fields of `Arcs` for circles in the plane of x and z."""
    local = points @ axes
    flat = local[:, :, [0, 2]]
    middle = flat.mean(axis=1)
    centred = flat - middle[:, None, :]
    # Least squares for |p|^2 = 2 c.p + e (Kasa): the circle's centre from moments up to the third.
    square = (centred * centred).sum(axis=2)
    square -= square.mean(axis=1, keepdims=True)
    moment = np.swapaxes(centred, 1, 2) @ centred
    moment += (1e-6 * np.trace(moment, axis1=1, axis2=2) + 1e-12)[:, None, None] * np.eye(2)
    side = np.swapaxes(centred, 1, 2) @ square[:, :, None]
    offset = centred - 0.5 * np.swapaxes(np.linalg.solve(moment, side), 1, 2)
    distance = np.sqrt((offset * offset).sum(axis=2))
    direction, half_angle = _angular_range(np.arctan2(offset[:, :, 1], offset[:, :, 0]))
    inner, outer = robust_bounds(distance[:, :, None], SLANTED * half_cell[:, None])
    inner, outer = np.maximum(inner[:, 0], 0.0), outer[:, 0]
    low, high = robust_bounds(local[:, :, 1:2], missing_margin(axes[:, :, 1:2], half_cell))
    # The middle of the arc is at `direction`, from x towards z; it must lie at -x of the new axes.
    cosine, sine = np.cos(direction)[:, None], np.sin(direction)[:, None]
    x = -(cosine * axes[:, :, 0] + sine * axes[:, :, 2])
    turned = np.stack([x, axes[:, :, 1], np.cross(x, axes[:, :, 1])], axis=2)
    centre = flat[:, 0] - offset[:, 0]
    at = np.stack([centre[:, 0], 0.5 * (low[:, 0] + high[:, 0]), centre[:, 1]], axis=1)
    world = (axes @ at[:, :, None])[:, :, 0]
    return turned, world, 0.5 * (inner + outer), half_angle, outer - inner, (high - low)[:, 0]


def _angular_range(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middle and half of what angles (R, m) fill of the circle, outside its longest empty stretch."""
    regions = len(angles)
    bins = ((angles + np.pi) * (ARC_BINS / (2 * np.pi))).astype(int) % ARC_BINS
    filled = np.zeros((regions, ARC_BINS), bool)
    filled[np.arange(regions)[:, None], bins] = True
    # Length of the empty stretch that ends at each bin, going round twice.
    gap = np.zeros((regions, 2 * ARC_BINS), int)
    for k in range(2 * ARC_BINS):
        gap[:, k] = np.where(filled[:, k % ARC_BINS], 0, gap[:, k - 1] + 1 if k else 1)
    end = gap.argmax(axis=1)
    length = np.minimum(gap[np.arange(regions), end], ARC_BINS)
    # Bin k begins at 2 pi k / ARC_BINS - pi; opposite of the middle of the gap is the middle of the arc.
    direction = (end + 1 - 0.5 * length) * (2 * np.pi / ARC_BINS)
    turned = (angles - direction[:, None] + np.pi) % (2 * np.pi) - np.pi
    low, high = robust_bounds(turned[:, :, None], np.zeros((regions, 1)))
    whole = length == 0
    middle = np.where(whole, 0.0, direction + 0.5 * (low + high)[:, 0])
    return middle, np.where(whole, np.pi, 0.5 * (high - low)[:, 0])
