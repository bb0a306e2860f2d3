"""Reflections and rotations that take a target to itself, found by its own distances at moved points.

Frame: normalised. Planes and axes are looked for through the middle of the box and through the centroid, along the
mesh's axes, their diagonals, and the principal axes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...kernels.rotation import rotation_about
from ...shape.target import Target

MOST_CHANGE = 0.012
"""Largest change of the distance, at 95 % of the points, that passes for symmetric: 0.7 % of the longest side."""

PROBES = (256, 4096)
"""Points of the first look, which most candidates fail, and of the second."""

ORDERS = (2, 3, 4, 5, 6, 8, 12)
"""Rotations by a full turn over these are tried."""

SAME_AXIS = 0.02
"""Directions nearer than this, in radians, are one candidate."""


@dataclass(frozen=True)
class Symmetry:
    """A plane (order 1) or an axis of rotation by a full turn over `order`."""

    name: str
    """`symmetry about x` for the plane across the x axis, `4-fold symmetry about z`, ..."""
    order: int
    axis: np.ndarray
    """(3,) unit normal of the plane, or direction of the axis."""
    centre: np.ndarray
    """(3,) a point on it."""
    change: float
    """95th percentile of the change of distance, normalised."""

    def turns(self) -> list[np.ndarray]:
        """The orthogonal matrices (3, 3), the identity not among them."""
        if self.order == 1:
            return [_clean(np.eye(3) - 2.0 * np.outer(self.axis, self.axis))]
        return [_clean(rotation_about(self.axis, 2.0 * np.pi * k / self.order)) for k in range(1, self.order)]

    def describe(self) -> dict[str, Any]:
        """For a report."""
        return {
            "name": self.name,
            "axis": [round(float(value), 6) for value in self.axis],
            "centre": [round(float(value), 6) for value in self.centre],
            "order": self.order,
        }


def find_symmetries(target: Target) -> list[Symmetry]:
    """Planes first, then axes with their highest order; the most exact first among either."""
    probe = _Probe(target)
    axes = []
    for axis, label in probe.directions:
        for order in reversed(ORDERS):
            spin = probe.best(f"{order}-fold symmetry about {label}", order, axis)
            if spin is not None:
                axes.append(spin)
                break
    return probe.planes() + sorted(axes, key=lambda found: (-found.order, round(found.change, 4)))


def find_planes(target: Target) -> list[Symmetry]:
    """Planes of mirror symmetry, the most exact first."""
    return _Probe(target).planes()


class _Probe:
    """The target's distances at moved points."""

    def __init__(self, target: Target):
        near, volume = target.samples.near, target.samples.volume
        self.target, self.points, self.distance = target, near.points, near.distance
        middle = 0.5 * (target.lower + target.upper)
        self.middle = np.where(np.abs(middle) < 1e-9, 0.0, middle)
        inside = volume.points[volume.distance < 0].astype(np.float64)
        self.centroid = inside.mean(axis=0) if len(inside) > 8 else self.middle
        self.directions = _directions(inside)

    def planes(self) -> list[Symmetry]:
        """Those that pass, the most exact first."""
        found = [self.best(f"symmetry about {label}", 1, axis) for axis, label in self.directions]
        return sorted(
            (plane for plane in found if plane is not None), key=lambda plane: round(plane.change, 4)
        )

    def best(self, name: str, order: int, axis: np.ndarray) -> Symmetry | None:
        """The more exact one of those through the middle and the centroid, if it passes."""
        centres = [_on_mesh(centre, axis, self.middle) for centre in (self.middle, self.centroid)]
        measured = [
            (self.change(candidate), candidate)
            for candidate in (Symmetry(name, order, axis, centre, 0.0) for centre in centres)
        ]
        change, candidate = min(measured, key=lambda entry: entry[0])
        return None if change > MOST_CHANGE else replace(candidate, change=change)

    def change(self, candidate: Symmetry) -> float:
        """95th percentile of the change of distance, infinite where the first look fails."""
        found = np.inf
        turn = candidate.turns()[0]
        for count in PROBES:
            step = max(1, len(self.points) // count)
            points = self.points[::step].astype(np.float64)
            moved = (points - candidate.centre) @ turn.T + candidate.centre
            there = self.target.query.signed_distance(moved.astype(np.float32))
            found = float(np.percentile(np.abs(there - self.distance[::step]), 95))
            if found > 2.0 * MOST_CHANGE:
                return np.inf
        return found


def _directions(inside: np.ndarray) -> list[tuple[np.ndarray, str]]:
    """Unit directions (3,) and their names: the mesh's axes, diagonals of two of them, and the principal axes."""
    found = [(np.eye(3)[k], "xyz"[k]) for k in range(3)]
    for a, b in ((0, 1), (1, 2), (2, 0)):
        for sign in (1.0, -1.0):
            axis = (np.eye(3)[a] + sign * np.eye(3)[b]) * np.sqrt(0.5)
            found.append((axis, f"{'xyz'[a]}{'+' if sign > 0 else '-'}{'xyz'[b]}"))
    if len(inside) > 8:
        for axis in np.linalg.eigh(np.cov(inside.T))[1].T:
            if all(abs(axis @ other) < np.cos(SAME_AXIS) for other, _ in found):
                axis = axis * np.sign(axis[np.abs(axis).argmax()])
                found.append((axis, "({:.2f}, {:.2f}, {:.2f})".format(*axis)))
    return found


def _on_mesh(centre: np.ndarray, axis: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """The point of the plane through `centre` that is nearest to the middle of the box: one plane, one number."""
    return middle + axis * ((centre - middle) @ axis)


def _clean(matrix: np.ndarray) -> np.ndarray:
    """Whole numbers where only rounding keeps them from it."""
    whole = np.round(matrix)
    return np.where(np.abs(matrix - whole) < 1e-12, whole, matrix)
