"""How good a set of primitives is: bits and scores on the objective's samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..kernels.field import primitives_at
from ..kernels.points import PointBlocks
from ..kernels.primitive_set import PrimitiveSet
from ..kernels.rows import BLEND, SHAPES
from .objective import Score, Tally
from .refine import fold

BLEND_CHOICES = (0.0, 0.01, 0.02, 0.04, 0.08)
"""Blend radii that are tried, normalised units."""


def values_at(
    rows: np.ndarray, families: Sequence[str], blocks: PointBlocks, device: wp.Device
) -> np.ndarray:
    """Distances (primitive_count, n) float32 of each primitive alone at the samples."""
    if not len(rows):
        return np.zeros((0, blocks.count), np.float32)
    primitives = PrimitiveSet(rows, families, device)
    return primitives_at(primitives, blocks).numpy().reshape(len(rows), -1)[:, : blocks.count]


def score_values(values: np.ndarray, blends: np.ndarray, tally: Tally, alpha: float) -> Score:
    """The objective of the smooth union from its primitives' distances at the samples."""
    if not len(values):
        nothing = np.zeros(len(tally.box), bool)
        return tally.score(nothing, nothing, 0, alpha)
    twice = (values < 0).sum(0) > 1
    return tally.score(fold(values, blends) < 0, twice, len(values), alpha)


def choose_blends(values: np.ndarray, rows: np.ndarray, tally: Tally, alpha: float) -> np.ndarray:
    """Rows with each blend set, in turn, to the choice that scores best while all others stay."""
    rows = rows.copy()
    prefix = values[:1]
    for k in range(1, len(rows)):
        best, best_score = rows[k, BLEND], -np.inf
        for choice in BLEND_CHOICES:
            rows[k, BLEND] = choice
            stack = np.concatenate([prefix[-1:], values[k:]])
            blends = np.concatenate([[0.0], rows[k:, BLEND]])
            covered = fold(stack, blends) < 0
            nothing = np.zeros(len(covered), bool)
            score = tally.score(covered, nothing, len(rows), alpha).objective
            # A blend must earn its place: no smooth joint where a plain one is as good.
            if score > best_score + (1e-5 if choice else 0.0):
                best, best_score = choice, score
        rows[k, BLEND] = best
        prefix = np.stack([prefix[-1], fold(np.stack([prefix[-1], values[k]]), rows[k - 1 : k + 1, BLEND])])
    return rows


def rough_volume(rows: np.ndarray) -> np.ndarray:
    """Volumes of the primitives' boxes, to order them by."""
    return rows[:, SHAPES : SHAPES + 3].prod(1)


def sorted_by_volume(pool: np.ndarray, chosen: list[int]) -> np.ndarray:
    """The chosen indices, biggest primitive first: the order that the union folds in."""
    index = np.array(chosen)
    return index[np.argsort(-rough_volume(pool[index]), kind="stable")]
