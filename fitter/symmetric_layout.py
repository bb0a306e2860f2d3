"""The parts of an assembly tied by the symmetries of its target: copied across, or made symmetric where astride."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kernels.rows import BLEND
from .judge import Judge
from .placement import move_rows
from .symmetry import Symmetry
from .ties import Copied, Ties, symmetric_row

MATCH = 0.45
"""IoU, on the samples, of a part's image and another part for the two to be the same: both were fitted freely."""

SELF_MATCH = 0.6
"""The same for a part that a motion takes to itself."""

Motion = tuple[np.ndarray, np.ndarray]
"""turn (3, 3) and shift (3,): p = turn @ q + shift."""


@dataclass(frozen=True)
class Layout:
    """Rows and ties, and which rows have no partner."""

    rows: np.ndarray
    ties: Ties
    alone: tuple[tuple[int, tuple[Motion, ...]], ...]
    """Primitives with images where there is no part, and the motions to them."""


def motions_of(symmetries: list[Symmetry], most: int = 24) -> list[Motion]:
    """All motions that some symmetries generate, without the identity; none where they are more than `most`."""
    generators = [
        (turn, found.centre - turn @ found.centre) for found in symmetries for turn in found.turns()[:1]
    ]
    group: list[Motion] = [(np.eye(3), np.zeros(3))]
    for known in group:
        for turn, shift in generators:
            product = (turn @ known[0], turn @ known[1] + shift)
            if not any(_same(product, other) for other in group):
                group.append(product)
        if len(group) > most:
            return []
    return group[1:]


def lay_out(rows: np.ndarray, motions: list[Motion], judge: Judge, fixed: set[int]) -> Layout:
    """Match every part's images with parts, and tie what matches.

    Args:
        rows: (primitive_count, ROW).
        motions: a group without the identity.
        judge: tells what parts hold.
        fixed: primitives that are tied already, and stay out of it.
    """
    families = judge.families(rows)
    bits = judge.values(rows) < 0
    weight = judge.tally.weight
    left = [index for index in np.argsort(-(bits @ weight), kind="stable").tolist() if index not in fixed]
    rows = rows.copy()
    copies: list[Copied] = []
    astride: dict[int, tuple[Motion, ...]] = {}
    alone: list[tuple[int, tuple[Motion, ...]]] = []
    while left:
        index = left.pop(0)
        images = np.concatenate([move_rows(rows[index : index + 1], t, np.zeros(3), s) for t, s in motions])
        shares = _shares(judge.values(images) < 0, bits, weight)
        self_motions = tuple(m for m, share in zip(motions, shares, strict=True) if share[index] > SELF_MATCH)
        if self_motions:
            astride[index] = self_motions
            rows[index] = symmetric_row(rows[index], families[index], self_motions)
        missing, taken, placed = [], [], [rows[index]]
        for number, (turn, shift) in enumerate(motions):
            image = move_rows(rows[index : index + 1], turn, np.zeros(3), shift)
            if shares[number, index] > SELF_MATCH or _is_there(image[0], placed):
                continue
            placed.append(image[0])
            partner = max(left, key=lambda other: shares[number, other], default=None)
            if partner is None or shares[number, partner] < MATCH:
                missing.append((turn, shift))
                continue
            left.remove(partner)
            taken.append(Copied(index, partner, turn, shift))
        copies += taken
        if missing:
            alone.append((index, tuple(missing)))
    ties = Ties(tuple(copies), astride)
    return Layout(ties.complete(rows, families), ties, tuple(alone))


def add_missing(layout: Layout, judge: Judge, most: int) -> list[Layout]:
    """For each part without a partner, in turn: the layouts in which it got one, and in which it is gone.

    Returns:
        Candidates for the caller to judge; each is made from `layout` alone.
    """
    found = []
    for index, motions in layout.alone:
        rest = tuple(entry for entry in layout.alone if entry[0] != index)
        if len(layout.rows) + len(motions) <= most:
            images = [move_rows(layout.rows[index : index + 1], t, np.zeros(3), s) for t, s in motions]
            rows = np.concatenate([layout.rows, *images])
            rows[len(layout.rows) :, BLEND] = 0.0
            more = [Copied(index, len(layout.rows) + k, t, s) for k, (t, s) in enumerate(motions)]
            ties = Ties((*layout.ties.copies, *more), layout.ties.astride)
            found.append(Layout(ties.complete(rows, judge.families(rows)), ties, rest))
    return found


def _shares(images: np.ndarray, bits: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Weighted IoU (images, parts) of what images (i, n) and parts (k, n) hold."""
    common = (images * weight) @ bits.T.astype(np.float64)
    union = (images @ weight)[:, None] + (bits @ weight)[None] - common
    return common / np.maximum(union, 1e-9)


def _is_there(image: np.ndarray, placed: list[np.ndarray]) -> bool:
    """Whether an image lies where another image of the same part lies."""
    return any(np.abs(image[:3] - other[:3]).max() < 1e-4 and _alike(image, other) for other in placed)


def _alike(image: np.ndarray, other: np.ndarray) -> bool:
    return abs(float(image[3:7].astype(np.float64) @ other[3:7])) > 0.999


def _same(a: Motion, b: Motion) -> bool:
    return bool(np.abs(a[0] - b[0]).max() < 1e-4 and np.abs(a[1] - b[1]).max() < 1e-4)
