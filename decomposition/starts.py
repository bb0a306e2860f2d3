"""Starting primitives for a region: many hypotheses of what it is, of which fitting keeps the best.

Conventions of the SuperFrustum: the local z axis is swept along; a positive bulge arcs towards -x, its chord, of length
size z, along z. The rows of other families are the hypotheses that their parameters can express.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..kernels.primitives import Family
from ..kernels.primitives import family as find_family
from ..kernels.rows import ROTATION, SHAPES, TRANSLATION, empty_rows
from .frames import Arc, Placement, box_volume, find_arcs, place, principal_axes
from .region import Region

STARTS = 33
"""Hypotheses a region, at most."""

SAMPLES = 768
"""Points of a region that starts are estimated from."""

TIGHTER = 1.1
"""World axes are tried, too, unless their box is this many times larger than that of the principal axes."""

SLENDER = 0.1
"""Share of the smallest extent that is left of a size where dilation makes up the rest."""


@dataclass(frozen=True)
class Hypothesis:
    """A primitive in the terms of the SuperFrustum."""

    kind: str
    axes: np.ndarray
    """(3, 3), columns are its local axes in the normalised frame, right-handed."""
    centre: np.ndarray
    """(3,), normalised frame."""
    size: np.ndarray
    """(3,) full extents before dilation."""
    roundness: float = 1.0
    dilation: float = 0.0
    taper: float = 1.0
    bulge: float = 0.0
    onion: float = -1.0


def region_starts(
    region: Region | np.ndarray,
    family: str = "superfrustum",
    count: int = STARTS,
    half_cell: float = 1.0 / 128.0,
) -> tuple[np.ndarray, list[str]]:
    """Starting rows for one region, the most different hypotheses first.

    Args:
        region: a region, or points (m, 3) spread over its volume, normalised frame.
        family: of the primitives.
        count: rows at most.
        half_cell: what the points' extents fall short of the region's on either side; a region knows its own.

    Returns:
        Rows (s, ROW) float32 with blend 0 and gate 1, and their kinds; none for a region without points.
    """
    if isinstance(region, Region):
        points, half_cell = region.sample(SAMPLES), 1.0 / region.resolution
    else:
        points = np.asarray(region)
    if len(points) == 0:
        return empty_rows(0), []
    entry = find_family(family)
    guesses = [
        guess for guess in hypotheses(points.astype(np.float64), half_cell) if _expressible(guess, entry)
    ]
    guesses = guesses[:count]
    return hypothesis_rows(guesses, entry), [guess.kind for guess in guesses]


def all_starts(
    regions: Sequence[Region | np.ndarray], family: str = "superfrustum", count: int = STARTS
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """`region_starts` of many regions: rows (s, ROW), the region (s,) int32 that each is for, and the kinds."""
    rows, owners, kinds = [empty_rows(0)], [np.zeros(0, np.int32)], []
    for index, region in enumerate(regions):
        found, names = region_starts(region, family, count)
        rows.append(found)
        owners.append(np.full(len(found), index, np.int32))
        kinds += names
    return np.concatenate(rows), np.concatenate(owners), kinds


def hypotheses(points: np.ndarray, half_cell: float) -> list[Hypothesis]:
    """What points (m, 3) could be, the most different guesses first."""
    principal = principal_axes(points)
    frames = [principal]
    world = np.eye(3)[:, [2, 0, 1]]
    ratio = box_volume(points, world, half_cell) / box_volume(points, principal, half_cell)
    if ratio <= TIGHTER:
        frames = [world, principal] if ratio <= 1.0 else [principal, world]
    arcs = [guess for arc in find_arcs(points, frames[0], half_cell) for guess in _arc_guesses(arc)]
    first = place(points, frames[0], half_cell)
    guesses = [guess for placement in first for guess in _upright_guesses(placement)]
    guesses += arcs
    guesses += [_pill(placement) for placement in first]
    for axes in frames[1:]:
        for placement in place(points, axes, half_cell):
            guesses += _upright_guesses(placement)[:2]
    for placement in first:
        guesses += _bent_guesses(placement)
    return guesses


def _upright_guesses(placement: Placement) -> list[Hypothesis]:
    """Box, cylinder, tube, ring and cones along one axis, in its order of usefulness."""
    base = Hypothesis("cylinder", placement.axes, placement.centre, placement.extent)
    box = replace(base, kind="box", roundness=0.1)
    hole = placement.hole
    tube = replace(base, kind="tube", onion=float(np.clip(hole, 0.5, 0.92)) if hole > 0.3 else 0.6)
    guesses = [box, base, tube, _ring(placement), _cone(placement)]
    return guesses


def _ring(placement: Placement) -> Hypothesis:
    """A torus-like ring: a thin rim, all of whose thickness is dilation."""
    inset = 0.5 * min(placement.extent[0], placement.extent[1])
    wall = 0.5 * inset * (1.0 - placement.hole) if placement.hole > 0.2 else 0.3 * inset
    dilation = min(0.5 * placement.extent[2], wall) * (1.0 - SLENDER)
    size = placement.extent - 2.0 * dilation
    return Hypothesis("ring", placement.axes, placement.centre, size, dilation=dilation, onion=0.9)


def _cone(placement: Placement) -> Hypothesis:
    """A taper towards the end that is narrower."""
    axes, taper = placement.axes, placement.taper
    if taper > 1.0:
        # Turned round x: z and y change sides, and what was wide at the top is wide at the bottom.
        axes, taper = axes * np.array([1.0, -1.0, -1.0]), 1.0 / taper
    return Hypothesis(
        "cone", axes, placement.centre, placement.extent, 0.9, taper=float(np.clip(taper, 0.05, 0.7))
    )


def _pill(placement: Placement) -> Hypothesis:
    """All edges rounded: a thin core with dilation."""
    dilation = 0.5 * placement.extent.min() * (1.0 - 2.0 * SLENDER)
    size = placement.extent - 2.0 * dilation
    return Hypothesis("pill", placement.axes, placement.centre, size, dilation=dilation)


def _arc_guesses(arc: Arc) -> list[Hypothesis]:
    """The bent bar that fills a circle's arc, or the whole ring where it is more than half of one."""
    guesses = []
    theta = min(arc.half_angle, 0.5 * np.pi)
    if theta > 0.12:
        half_chord = arc.radius * np.sin(theta)
        size = np.array([arc.width, arc.height, 2.0 * half_chord])
        # The primitive's origin is the middle of the chord, at radius * cos(theta) from the arc's centre towards -x.
        centre = arc.centre - arc.axes[:, 0] * arc.radius * np.cos(theta)
        guesses.append(Hypothesis("arc", arc.axes, centre, size, 0.5, bulge=float(theta / (0.5 * np.pi))))
    if arc.half_angle > 0.6 * np.pi:
        outer = arc.radius + 0.5 * arc.width
        size = np.array([2.0 * outer, 2.0 * outer, arc.height])
        axes = arc.axes[:, [2, 0, 1]]
        hole = float(np.clip((arc.radius - 0.5 * arc.width) / outer, 0.3, 0.95))
        guesses.append(Hypothesis("hoop", axes, arc.centre, size, onion=hole))
    return guesses


def _bent_guesses(placement: Placement) -> list[Hypothesis]:
    """Bars bent towards +x, -x, +y and -y inside the box, with half a bulge."""
    guesses = []
    theta = 0.25 * np.pi
    sine, cosine, slope = np.sin(theta), np.cos(theta), np.tan(0.5 * theta)
    for name, turn in _TURNS.items():
        axes = placement.axes @ turn
        wide, deep, long = np.abs(turn).T @ placement.extent
        # Box of a bent bar: long = 2 h + w sin, wide = h tan(theta / 2) + w (1 + cos) / 2, with h half the chord.
        width = np.clip((wide - 0.5 * long * slope) / cosine, 0.2 * wide, wide)
        half_chord = max(0.5 * (long - width * sine), 0.25 * long)
        # From the outer side of the apex, at -x of the box, to the chord.
        inward = -0.5 * wide + 0.5 * width + half_chord * slope
        centre = placement.centre + axes[:, 0] * inward
        size = np.array([width, deep, 2.0 * half_chord])
        guesses.append(Hypothesis(f"bent {name}", axes, centre, size, 0.5, bulge=0.5))
    return guesses


_TURNS = {
    "-x": np.diag([1.0, 1.0, 1.0]),
    "+x": np.diag([-1.0, -1.0, 1.0]),
    "-y": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "+y": np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
}
"""Turns about z that bring the local -x to the side a bar is bent towards."""


def _expressible(guess: Hypothesis, entry: Family) -> bool:
    """Whether a family has the parameters that make this hypothesis what it is."""
    names = {parameter.name for parameter in entry.parameters}
    needed = {
        "taper": guess.taper != 1.0,
        "bulge": guess.bulge != 0.0,
        "onion": guess.onion > 0.0,
        "dilation": guess.dilation > 0.0 and "exponents" not in names,
        # A family with neither roundness nor exponents has boxes only.
        "roundness": guess.roundness > 0.5 and "exponents" not in names,
    }
    return all(name in names for name, used in needed.items() if used)


def hypothesis_rows(guesses: Sequence[Hypothesis], entry: Family) -> np.ndarray:
    """Rows (s, ROW) float32 of hypotheses, every shape inside the family's fit range."""
    rows = empty_rows(len(guesses))
    if not guesses:
        return rows
    low, high = entry.fit_range
    names = {parameter.name for parameter in entry.parameters}
    for row, guess in zip(rows, guesses, strict=True):
        row[TRANSLATION : TRANSLATION + 3] = guess.centre
        values = {name: getattr(guess, name) for name in names if hasattr(guess, name)}
        if "dilation" not in names:
            values["size"] = guess.size + 2.0 * guess.dilation
        if "exponents" in names:
            values["exponents"] = (1.0 if guess.dilation > 0.0 else 0.2, 0.2 + 0.8 * guess.roundness)
        row[SHAPES : SHAPES + len(low)] = np.clip(entry.shape_row(**values), low, high)
    rows[:, ROTATION : ROTATION + 4] = quaternions(np.stack([guess.axes for guess in guesses]))
    return rows


def quaternions(axes: np.ndarray) -> np.ndarray:
    """Unit quaternions (s, 4), (w, x, y, z) with w >= 0, of rotation matrices (s, 3, 3), local to world."""
    xx, yy, zz = axes[:, 0, 0], axes[:, 1, 1], axes[:, 2, 2]
    # The symmetric matrix whose eigenvector to the largest eigenvalue is the quaternion (Bar-Itzhack).
    k = np.empty((len(axes), 4, 4))
    k[:, 0, 0], k[:, 1, 1] = xx + yy + zz, xx - yy - zz
    k[:, 2, 2], k[:, 3, 3] = yy - xx - zz, zz - xx - yy
    k[:, 0, 1] = k[:, 1, 0] = axes[:, 2, 1] - axes[:, 1, 2]
    k[:, 0, 2] = k[:, 2, 0] = axes[:, 0, 2] - axes[:, 2, 0]
    k[:, 0, 3] = k[:, 3, 0] = axes[:, 1, 0] - axes[:, 0, 1]
    k[:, 1, 2] = k[:, 2, 1] = axes[:, 1, 0] + axes[:, 0, 1]
    k[:, 1, 3] = k[:, 3, 1] = axes[:, 2, 0] + axes[:, 0, 2]
    k[:, 2, 3] = k[:, 3, 2] = axes[:, 2, 1] + axes[:, 1, 2]
    q = np.linalg.eigh(k)[1][:, :, -1]
    return (q * np.where(q[:, :1] < 0.0, -1.0, 1.0)).astype(np.float32)
