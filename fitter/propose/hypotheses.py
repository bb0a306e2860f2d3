"""Shape hypotheses of regions: rounded profiles that are swept, guessed from how the regions lie.

Conventions: the local z axis is swept along; a positive bulge arcs towards -x, its chord, of length size z, along z.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ...decomposition.oriented_boxes import (
    Arcs,
    Placements,
    find_arcs,
    missing_margin,
    place,
    principal_axes,
    robust_bounds,
)
from ...kernels.primitives.swept_solids import SweptSolids

TIGHTER = 1.1
"""World axes are tried, too, unless their box is this many times larger than that of the principal axes."""

SLENDER = 0.1
"""Share of the smallest extent that is left of a size where dilation makes up the rest."""

HOLLOW = 0.15
"""Hole share above which a region is taken to be hollow along an axis; below, a usual hole is assumed."""

LOOKS_BENT = 0.12
"""Half angle of an arc, in radians, below which a bar is as good as straight."""


@dataclass(frozen=True)
class Hypotheses:
    """One guess for each of some regions."""

    region: np.ndarray
    """(g,) int32, the region each guess is for."""
    priority: np.ndarray
    """(g,) float32, lower is tried first."""
    kind: np.ndarray
    """(g,) str."""
    axes: np.ndarray
    """(g, 3, 3), columns are the local axes in the normalised frame, right-handed."""
    centre: np.ndarray
    """(g, 3), normalised frame."""
    size: np.ndarray
    """(g, 3) full extents before dilation."""
    roundness: np.ndarray
    dilation: np.ndarray
    taper: np.ndarray
    bulge: np.ndarray
    onion: np.ndarray
    """(g,) each, as the SuperFrustum's parameters."""

    @property
    def solids(self) -> SweptSolids:
        """Swept solids of the guesses, each in its frame."""
        return SweptSolids(self.size, self.roundness, self.dilation, self.taper, self.bulge, self.onion)

    def take(self, chosen: np.ndarray) -> Hypotheses:
        """The guesses that an index or mask array picks."""
        return Hypotheses(*(getattr(self, field.name)[chosen] for field in fields(self)))


def guess_shapes(points: np.ndarray, covariance: np.ndarray, half_cell: np.ndarray) -> Hypotheses:
    """All guesses for R regions, in order of region and then priority.

    Args:
        points: (R, m, 3) float, as many points of each region, normalised frame.
        covariance: (R, 3, 3) of the regions' points.
        half_cell: (R,) what the points' extents fall short of the region's on either side.
    """
    first, second, doubtful = _frames(points, covariance, half_cell)
    near = place(points, first, half_cell)
    arcs = find_arcs(points, first, half_cell)
    parts = [*_upright(near, np.ones(len(points), bool)), *_arc_bars(arcs)]
    if doubtful.any():
        other = place(points[doubtful], second[doubtful], half_cell[doubtful])
        parts += _upright(other, np.zeros(int(doubtful.sum()), bool), np.flatnonzero(doubtful))
    parts += _bent(near)
    together = Hypotheses(
        *(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Hypotheses))
    )
    return together.take(np.lexsort((together.priority, together.region)))


def _frames(
    points: np.ndarray, covariance: np.ndarray, half_cell: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First and second choice of axes (R, 3, 3), and where (R,) the second is about as good."""
    principal = principal_axes(points, covariance)
    world = np.broadcast_to(np.eye(3), principal.shape)
    boxes = []
    for axes in (world, principal):
        low, high = robust_bounds(points @ axes, missing_margin(axes, half_cell))
        boxes.append(np.prod(high - low, axis=1))
    ratio = boxes[0] / boxes[1]
    # Of two boxes alike, the one that stands straight.
    straight = (ratio <= 1.02)[:, None, None]
    return np.where(straight, world, principal), np.where(straight, principal, world), ratio <= TIGHTER


def _make(region: np.ndarray, priority: float | np.ndarray, kind: str, axes: np.ndarray, centre: np.ndarray,
          size: np.ndarray, **shape: float | np.ndarray) -> Hypotheses:  # fmt: skip
    """Guesses with what `shape` does not name at its default: a solid upright disc or stadium."""
    defaults = {"roundness": 1.0, "dilation": 0.0, "taper": 1.0, "bulge": 0.0, "onion": -1.0}
    count = len(region)
    columns = {name: np.broadcast_to(shape.get(name, value), count) for name, value in defaults.items()}
    order = np.broadcast_to(np.asarray(priority, np.float32), count)
    return Hypotheses(region, order, np.full(count, kind, object), axes, centre, size, **columns)


def _upright(at: Placements, full: np.ndarray, region: np.ndarray | None = None) -> list[Hypotheses]:
    """Guesses along each sweep axis; boxes and cylinders only where `full` (R,) is false."""
    regions = len(at.axes)
    owner = np.repeat(np.arange(regions) if region is None else region, 3).astype(np.int32)
    axes, centre = at.axes.reshape(-1, 3, 3), at.centre.reshape(-1, 3)
    extent, hole, taper = at.extent.reshape(-1, 3), at.hole.reshape(-1), at.taper.reshape(-1)
    # Sweeps in order of how well they suit: hollow ones first, then long ones.
    rank = (
        (-at.hole * (at.hole > HOLLOW) * 10.0 - at.extent[:, :, 2])
        .argsort(axis=1)
        .argsort(axis=1)
        .reshape(-1)
    )
    late = np.where(np.repeat(full, 3), 0.0, 30.0)
    hollow = hole > HOLLOW
    guesses = [
        _make(owner, late + rank * 2.0, "box", axes, centre, extent, roundness=0.1),
        _make(owner, late + rank * 2.0 + 1.0, "cylinder", axes, centre, extent),
    ]
    if not full.all():
        return guesses
    onion = np.where(hollow, np.clip(hole, 0.3, 0.93), 0.6)
    usual = np.where(hollow, 3.0, 14.0 + 4.0 * rank)
    guesses.append(_make(owner, usual, "tube", axes, centre, extent, onion=onion))
    guesses.append(_make(owner, usual + np.where(hollow, 1.0, 20.0), "frame", axes, centre, extent, roundness=0.1,
                         onion=onion))  # fmt: skip
    # A ring whose thickness is all dilation, like a torus.
    inset = 0.5 * np.minimum(extent[:, 0], extent[:, 1])
    wall = np.where(hollow, 0.5 * inset * (1.0 - hole), 0.3 * inset)
    rim = np.minimum(0.5 * extent[:, 2], wall) * (1.0 - SLENDER)
    guesses.append(_make(owner, usual + 1.0, "ring", axes, centre, extent - 2.0 * rim[:, None], dilation=rim,
                         onion=0.9))  # fmt: skip
    # Tapers point to the end that is narrower: turned round x where that is the lower one.
    turned = np.where((taper > 1.0)[:, None], np.array([1.0, -1.0, -1.0]), 1.0)
    pointed = axes * turned[:, None, :]
    narrow = np.where(taper > 1.0, 1.0 / np.maximum(taper, 1.0), taper)
    sharp = np.clip(narrow, 0.05, 0.7)
    guesses.append(_make(owner, 11.0 + rank - 4.0 * (narrow < 0.6), "cone", pointed, centre, extent, roundness=0.9,
                         taper=sharp))  # fmt: skip
    guesses.append(_make(owner, usual + 2.0, "funnel", pointed, centre, extent, taper=sharp,
                         onion=np.where(hollow, onion, 0.8)))  # fmt: skip
    round_edge = 0.5 * extent.min(axis=1) * (1.0 - SLENDER)
    guesses.append(_make(owner, 9.0 + 12.0 * rank, "pill", axes, centre, extent - 2.0 * round_edge[:, None],
                         dilation=round_edge))  # fmt: skip
    return guesses


def _arc_bars(arcs: Arcs) -> list[Hypotheses]:
    """The bent bars that fill the arcs, and whole rings where they are more than half of one."""
    owner = np.repeat(np.arange(len(arcs.axes)), 3).astype(np.int32)
    axes, centre = arcs.axes.reshape(-1, 3, 3), arcs.centre.reshape(-1, 3)
    radius, half_angle = arcs.radius.reshape(-1), arcs.half_angle.reshape(-1)
    width, height = arcs.width.reshape(-1), arcs.height.reshape(-1)
    theta = np.minimum(half_angle, 0.5 * np.pi)
    size = np.stack([width, height, 2.0 * radius * np.sin(theta)], axis=1)
    # The primitive's origin is the middle of the chord: radius * cos(theta) from the arc's centre, towards -x.
    chord = centre - axes[:, :, 0] * (radius * np.cos(theta))[:, None]
    # Slender arcs are likelier than fat ones, whose circle is anybody's guess.
    fat = np.minimum(width / np.maximum(2.0 * radius * theta, 1e-6), 2.0)
    bars = _make(owner, 5.0 + 8.0 * fat, "arc", axes, chord, size, roundness=0.7, bulge=theta / (0.5 * np.pi))
    outer = radius + 0.5 * width
    disc = np.stack([2.0 * outer, 2.0 * outer, height], axis=1)
    hole = np.clip((radius - 0.5 * width) / outer, 0.3, 0.95)
    hoops = _make(owner, 4.0 + 8.0 * fat, "hoop", axes[:, :, [2, 0, 1]], centre, disc, onion=hole)
    return [bars.take(theta > LOOKS_BENT), hoops.take((half_angle > 0.6 * np.pi) & (radius > 0.6 * width))]


def _bent(at: Placements) -> list[Hypotheses]:
    """Bars bent towards -x, +x, -y and +y inside the box, with half a bulge."""
    theta = 0.25 * np.pi
    sine, cosine, slope = np.sin(theta), np.cos(theta), np.tan(0.5 * theta)
    owner = np.repeat(np.arange(len(at.axes)), 3).astype(np.int32)
    rank = (-at.extent[:, :, 2]).argsort(axis=1).argsort(axis=1).reshape(-1)
    guesses = []
    for step, (name, turn) in enumerate(_TURNS.items()):
        axes = (at.axes @ turn).reshape(-1, 3, 3)
        wide, deep, long = np.moveaxis(at.extent.reshape(-1, 3) @ np.abs(turn), 1, 0)
        # Box of a bent bar: long = 2 h + w sin, wide = h tan(theta / 2) + w (1 + cos) / 2, with h half the chord.
        width = np.clip((wide - 0.5 * long * slope) / cosine, 0.2 * wide, wide)
        half_chord = np.maximum(0.5 * (long - width * sine), 0.25 * long)
        # From the outer side of the apex, at -x of the box, to the chord.
        inward = -0.5 * wide + 0.5 * width + half_chord * slope
        centre = at.centre.reshape(-1, 3) + axes[:, :, 0] * inward[:, None]
        size = np.stack([width, deep, 2.0 * half_chord], axis=1)
        order = 20.0 + 8.0 * rank + step
        guesses.append(_make(owner, order, f"bent {name}", axes, centre, size, roundness=0.5, bulge=0.5))
    return guesses


_TURNS = {
    "-x": np.diag([1.0, 1.0, 1.0]),
    "+x": np.diag([-1.0, -1.0, 1.0]),
    "-y": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "+y": np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
}
"""Turns about z that bring the local -x to the side a bar is bent towards."""
