"""How good a set of primitives is: bits and scores on the objective's samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..kernels.field import primitives_at
from ..kernels.points import PointBlocks
from ..kernels.primitive_set import PrimitiveSet
from ..kernels.rows import BLEND, SHAPES
from .objective import UNOVERLAP_PRICE, Score, Tally
from .refine import fold

BLEND_CHOICES = (0.0, 0.01, 0.02, 0.035, 0.055)
"""Blend radii that are tried, ascending, normalised units."""


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
    return tally.score(fold(values, blends) < 0, (values < 0).sum(0), len(values), alpha)


def choose_blends(values: np.ndarray, rows: np.ndarray, tally: Tally) -> np.ndarray:
    """Rows with each blend set, in turn, to the choice that scores best while all others stay.

    Args:
        values: (primitive_count, n) distances at the samples.
        rows: (primitive_count, ROW).
        tally: the objective's sums.
    """
    rows = rows.copy()
    blends = rows[:, BLEND]
    union = fold(values, blends)
    held = tally.sums(union < 0)
    bare = (values.min(0) >= 0) & tally.box
    lone = int((bare & (union < 0)).sum())
    # A blend moves a surface by a quarter of itself at most.
    near = np.flatnonzero(np.abs(union) < max(BLEND_CHOICES[-1], float(blends.max(initial=0.0))))
    values, union, bare = values[:, near], union[near], bare[near]
    prefix = values[0]
    for k in range(1, len(rows)):
        widest = max(BLEND_CHOICES[-1], float(blends[k]))
        at = np.flatnonzero(np.abs(values[k] - prefix) < widest)
        rest = held - tally.sums(near[at[union[at] < 0]])
        other = lone - int((bare[at] & (union[at] < 0)).sum())
        stack = np.concatenate([prefix[None, at], values[k:, at]])
        best = (-np.inf, float(blends[k]), union[at], held, lone)
        for choice in (*BLEND_CHOICES, float(blends[k])):
            blends[k] = choice
            folded = fold(stack, np.concatenate([[0.0], blends[k:]]))
            sums = rest + tally.sums(near[at[folded < 0]])
            # A blend must earn its place: no smooth joint where a plain one is as good.
            alone = other + int((bare[at] & (folded < 0)).sum())
            score = float(tally.objective(np.append(sums, 0.0), 0, 0.0)) - (1e-5 if choice else 0.0)
            score -= UNOVERLAP_PRICE * alone / max(sums[2] + sums[3], 1.0)
            if score > best[0]:
                best = (score, choice, folded, sums, alone)
        _, blends[k], union[at], held, lone = best
        prefix = fold(np.stack([prefix, values[k]]), np.array([0.0, blends[k]]))
    return rows


def rough_volume(rows: np.ndarray) -> np.ndarray:
    """Volumes of the primitives' boxes, to order them by."""
    return rows[:, SHAPES : SHAPES + 3].prod(1)


def sorted_by_volume(pool: np.ndarray, chosen: list[int]) -> np.ndarray:
    """The chosen indices, biggest primitive first: the order that the union folds in."""
    index = np.array(chosen)
    return index[np.argsort(-rough_volume(pool[index]), kind="stable")]
