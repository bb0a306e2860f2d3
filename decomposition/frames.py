"""Where a region lies and how it is turned: axes to sweep along, extents, holes, tapers and arcs of its points.

Everything here is estimated from points (m, 3) of a region, in the frame they come in; nothing is fitted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

TAIL = 0.01
"""Share of the points beyond either end that extents leave out: a few stray cells must not stretch a start."""

ARC_BINS = 36
"""Directions round a circle in which points are looked for, to find where an arc ends."""


@dataclass(frozen=True)
class Placement:
    """A box along three axes that holds a region, and what its points look like when swept along z."""

    axes: np.ndarray
    """(3, 3), columns are the local x, y, z axes in the normalised frame; right-handed. z is the sweep axis."""
    centre: np.ndarray
    """(3,) of the box, normalised frame."""
    extent: np.ndarray
    """(3,) full extents along the local axes."""
    hole: float
    """Share of the profile's inset radius, from its middle, that holds no points; 0 for a solid one."""
    taper: float
    """Width of the profile at the upper end relative to the lower end; 1 for a prism, at least 0."""


@dataclass(frozen=True)
class Arc:
    """A circle through the points as seen along `axes` y, and how much of it they fill."""

    axes: np.ndarray
    """(3, 3), columns local x, y, z in the normalised frame: the arc bulges towards -x, its chord is along z."""
    centre: np.ndarray
    """(3,) of the circle, in the middle of the points' extent along y."""
    radius: float
    """Of the circle through the middle of the material."""
    half_angle: float
    """Half of the angle that the points fill, 0 to pi."""
    width: float
    """Thickness along the radius."""
    height: float
    """Thickness along y."""


def principal_axes(points: np.ndarray) -> np.ndarray:
    """Right-handed axes (3, 3), in columns, in order of falling spread of the points (m, 3)."""
    centred = points - points.mean(axis=0)
    _, vectors = np.linalg.eigh(centred.T @ centred)
    axes = vectors[:, ::-1].copy()
    # The sign of an eigenvector is arbitrary: its largest component is made positive.
    largest = np.abs(axes).argmax(axis=0)
    axes *= np.where(axes[largest, range(3)] < 0.0, -1.0, 1.0)
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] *= -1.0
    return axes


def robust_bounds(values: np.ndarray, half_cell: float) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bound of each column of `values` (m, k), without stray points, with half a cell added."""
    count = len(values)
    skip = int(TAIL * count)
    ordered = np.partition(values, (skip, count - 1 - skip), axis=0)
    return ordered[skip] - half_cell, ordered[count - 1 - skip] + half_cell


def place(points: np.ndarray, axes: np.ndarray, half_cell: float) -> list[Placement]:
    """The box of points (m, 3) along `axes`, once for each of the three as the sweep axis."""
    local = points @ axes
    low, high = robust_bounds(local, half_cell)
    centre, extent = 0.5 * (low + high), np.maximum(high - low, half_cell)
    placements = []
    for sweep in range(3):
        order = [(sweep + 1) % 3, (sweep + 2) % 3, sweep]
        shifted = (local - centre)[:, order]
        size = extent[order]
        hole = _hole_share(shifted, size, half_cell)
        taper = _taper_ratio(shifted, size)
        placements.append(Placement(axes[:, order], axes @ centre, size, hole, taper))
    return placements


def box_volume(points: np.ndarray, axes: np.ndarray, half_cell: float) -> float:
    """Volume of the box of the points along `axes`."""
    low, high = robust_bounds(points @ axes, half_cell)
    return float(np.prod(high - low))


def _hole_share(local: np.ndarray, size: np.ndarray, half_cell: float) -> float:
    # The inset of a point in a fully rounded profile, measured from the medial axis, as a share of the most.
    inset = 0.5 * min(size[0], size[1])
    core = np.maximum(np.abs(local[:, :2]) - (0.5 * size[:2] - inset), 0.0)
    depth = np.sqrt((core * core).sum(axis=1))
    skip = int(2 * TAIL * len(depth))
    return float(np.clip((np.partition(depth, skip)[skip] - half_cell) / inset, 0.0, 0.95))


def _taper_ratio(local: np.ndarray, size: np.ndarray) -> float:
    # Spread across the axis in the lowest and highest third, carried on from their middles to the ends.
    third = size[2] / 6.0
    upper, lower = local[local[:, 2] > third, :2], local[local[:, 2] < -third, :2]
    if len(upper) < 4 or len(lower) < 4:
        return 1.0
    top, bottom = upper.std(axis=0).sum(), lower.std(axis=0).sum()
    slope = (top - bottom) / (top + bottom + 1e-9) * 1.5
    return float((1.0 + slope) / (1.0 - slope)) if abs(slope) < 1.0 else (0.0 if slope < 0 else np.inf)


def find_arcs(points: np.ndarray, axes: np.ndarray, half_cell: float) -> list[Arc]:
    """The circle through the points as seen along each of three axes, where there is one."""
    found = []
    for normal in range(3):
        order = [(normal + 2) % 3, normal, (normal + 1) % 3]
        arc = _arc_in_plane(points, axes[:, order], half_cell)
        if arc is not None:
            found.append(arc)
    return found


def _arc_in_plane(points: np.ndarray, axes: np.ndarray, half_cell: float) -> Arc | None:
    local = points @ axes
    flat = local[:, [0, 2]]
    middle = flat.mean(axis=0)
    centred = flat - middle
    # Least squares for |p|^2 = 2 c.p + e (Kasa): the circle's centre from moments up to the third.
    square = (centred * centred).sum(axis=1)
    moment = centred.T @ centred
    if np.linalg.det(moment) < 1e-12 * np.trace(moment) ** 2:
        return None
    centre = 0.5 * np.linalg.solve(moment, centred.T @ (square - square.mean()))
    offset = centred - centre
    distance = np.sqrt((offset * offset).sum(axis=1))
    angles = np.arctan2(offset[:, 1], offset[:, 0])
    # Where the filled part of the circle ends: the widest gap between angles, found in bins.
    filled = np.zeros(ARC_BINS, bool)
    filled[((angles + np.pi) * (ARC_BINS / (2 * np.pi))).astype(int) % ARC_BINS] = True
    if filled.all():
        direction, half_angle = 0.0, np.pi
    else:
        start, length = _longest_gap(filled)
        direction = (start + 0.5 * length) * (
            2 * np.pi / ARC_BINS
        )  # opposite of the gap, less pi for the bins
        spread = (angles - direction + np.pi) % (2 * np.pi) - np.pi
        half_angle = 0.5 * float(np.quantile(spread, 1 - TAIL) - np.quantile(spread, TAIL))
    return _turned_arc(local, axes, middle + centre, distance, direction, half_angle, half_cell)


def _turned_arc(
    local: np.ndarray,
    axes: np.ndarray,
    centre: np.ndarray,
    distance: np.ndarray,
    direction: float,
    half_angle: float,
    half_cell: float,
) -> Arc:
    inner, outer = robust_bounds(distance[:, None], half_cell)
    low, high = robust_bounds(local[:, 1:2], half_cell)
    # The middle of the arc is at `direction`, from x towards z; it must lie at -x of the new axes.
    away = np.cos(direction) * axes[:, 0] + np.sin(direction) * axes[:, 2]
    x = -away
    y = axes[:, 1]
    turned = np.stack([x, y, np.cross(x, y)], axis=1)
    world = axes @ np.array([centre[0], 0.5 * (low[0] + high[0]), centre[1]])
    inner_radius = max(0.0, float(inner[0]))
    return Arc(
        turned,
        world,
        0.5 * (inner_radius + float(outer[0])),
        half_angle,
        float(outer[0]) - inner_radius,
        float(high[0] - low[0]),
    )


def _longest_gap(filled: np.ndarray) -> tuple[int, int]:
    """First bin and length of the longest run of empty bins, round the circle."""
    start = int(np.argmax(filled))
    turned = np.roll(filled, -start)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], turned, [True]]).astype(int)))
    begins, ends = edges[::2], edges[1::2]
    longest = int(np.argmax(ends - begins))
    return int(begins[longest] + start) % len(filled), int(ends[longest] - begins[longest])
