"""Primitives tied to one another: copies that follow from others, and parts that are symmetric in themselves.

A tie holds exactly: after every change of the free primitives the others are made anew from them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...kernels.primitives import family
from ...kernels.rotation import matrix_of, multiply
from ...kernels.rows import BLEND, ROTATION, TRANSLATION
from .canonical import is_prism, is_round, is_straight, shape_of, with_shape
from .rigid_motion import canonical_sign, move_rows

NEARLY = 0.15
"""Parameters up to this from the values that a symmetry asks for may be given up for it."""


@dataclass(frozen=True)
class Copied:
    """Primitive `index` is `source` moved: p = turn @ q + shift."""

    source: int
    index: int
    turn: np.ndarray
    shift: np.ndarray


@dataclass(frozen=True)
class Constraints:
    """All ties of an assembly."""

    copies: tuple[Copied, ...] = ()
    astride: dict[int, tuple[tuple[np.ndarray, np.ndarray], ...]] = field(default_factory=dict)
    """Index of a primitive, and the motions (turn, shift) that take it to itself."""

    def free(self, count: int) -> list[int]:
        """Indices of the primitives that follow from no other."""
        tied = {copy.index for copy in self.copies}
        return [index for index in range(count) if index not in tied]

    def followers(self, index: int) -> list[int]:
        """A primitive and all that follow from it, ascending."""
        return sorted([index, *(copy.index for copy in self.copies if copy.source == index)])

    def complete(self, rows: np.ndarray, families: Sequence[str]) -> np.ndarray:
        """Rows in which every tie holds; the free primitives decide."""
        rows = rows.copy()
        for index, motions in self.astride.items():
            rows[index] = symmetric_row(rows[index], families[index], motions)
        for copy in self.copies:
            blend = rows[copy.index, BLEND]
            moved = move_rows(rows[copy.source : copy.source + 1], copy.turn, np.zeros(3), copy.shift)
            rows[copy.index] = moved[0]
            rows[copy.index, ROTATION : ROTATION + 4] = _plainest(moved[0], families[copy.index])
            # How a part joins those before it depends on its place in the list, not on its shape.
            rows[copy.index, BLEND] = blend
        return rows


def symmetric_row(row: np.ndarray, name: str, motions: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """A row (ROW,) made such that motions (turn, shift) take its primitive to itself, as far as its family can.

    Centre and orientation become the mean of what the motions make of them. An orientation is compared in whichever
    of the primitive's own symmetric positions is nearest; one that asks for other parameters gets them.
    """
    changed = _symmetric(row, name, motions)
    # Once symmetric, rounding shall not move it again and again.
    return row if np.abs(changed - row).max() < 2e-6 else changed


def _symmetric(row: np.ndarray, name: str, motions: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """The same, but for the rounding."""
    changed = row.copy()
    images = [move_rows(row[None], turn, np.zeros(3), shift)[0] for turn, shift in motions]
    places = np.stack([row, *images])[:, TRANSLATION : TRANSLATION + 3].astype(np.float64)
    changed[TRANSLATION : TRANSLATION + 3] = places.mean(axis=0)
    own = row[ROTATION : ROTATION + 4].astype(np.float64)
    if is_round(row, name, NEARLY):
        changed[ROTATION : ROTATION + 4] = _mean_axis(row, name, images, own)
        return changed
    straight, prism, quaternions = False, False, [own]
    for image in images:
        found = image[ROTATION : ROTATION + 4].astype(np.float64)
        best, bends, tapers = max(
            ((multiply(found, turn), bends, tapers) for turn, bends, tapers in _own_turns(row, name)),
            key=lambda entry: abs(float(entry[0] @ own)),
        )
        quaternions.append(best if best @ own > 0 else -best)
        straight, prism = straight or bends, prism or tapers
    mean = np.mean(quaternions, axis=0)
    changed[ROTATION : ROTATION + 4] = tidy(mean)
    symmetries, shape = family(name).symmetries, shape_of(changed)
    if straight:
        shape = family(name).with_values(shape, symmetries.half_turn_z)
    return with_shape(changed, family(name).with_values(shape, symmetries.half_turn_x) if prism else shape)


def tidy(quaternion: np.ndarray) -> np.ndarray:
    """A quaternion (4,) of length 1, without traces of numbers that are meant to be 0."""
    unit = quaternion / np.linalg.norm(quaternion)
    unit = np.where(np.abs(unit) < 1e-6, 0.0, unit)
    return canonical_sign(unit / np.linalg.norm(unit))


def turn_between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The quaternion (4,) of the shortest rotation that takes one unit vector (3,) to another, not its opposite."""
    return tidy(np.concatenate([[1.0 + start @ end], np.cross(start, end)]))


def _plainest(row: np.ndarray, name: str) -> np.ndarray:
    """Of the quaternions (4,) that say the same of a primitive, the one nearest to no rotation."""
    own = row[ROTATION : ROTATION + 4].astype(np.float64)
    found = [multiply(own, turn) for turn, _, _ in _own_turns(row, name, 0.0)]
    # Rounded, so that of equally near ones it is always the first; and no zero is negative.
    return canonical_sign(max(found, key=lambda turned: round(abs(float(turned[0])), 5))) + 0.0


def _own_turns(row: np.ndarray, name: str, near: float = NEARLY) -> list[tuple[np.ndarray, bool, bool]]:
    """Rotations that take the primitive to itself, and whether each is a turn about z, and over."""
    turns = [(np.array([1.0, 0.0, 0.0, 0.0]), False, False)]
    straight, prism = is_straight(row, name, near), is_prism(row, name, near)
    if straight:
        turns.append((np.array([0.0, 0.0, 0.0, 1.0]), True, False))
    if prism:
        turns.append((np.array([0.0, 1.0, 0.0, 0.0]), False, True))
    if straight and prism:
        turns.append((np.array([0.0, 0.0, 1.0, 0.0]), True, True))
    return turns


def _mean_axis(row: np.ndarray, name: str, images: list[np.ndarray], own: np.ndarray) -> np.ndarray:
    """The row's quaternion turned the shortest way to the mean of the images' sweep axes."""
    axis = matrix_of(own)[:, 2]
    axes = [axis]
    for image in images:
        other = matrix_of(image[ROTATION : ROTATION + 4])[:, 2]
        either = is_prism(row, name, NEARLY) and other @ axis < 0
        axes.append(-other if either else other)
    mean = np.sum(axes, axis=0)
    length = float(np.linalg.norm(mean))
    if length < 1e-3:
        return own
    mean = np.where(np.abs(mean) < 1e-6 * length, 0.0, mean / length)
    return tidy(multiply(turn_between(axis, mean / np.linalg.norm(mean)), own))
