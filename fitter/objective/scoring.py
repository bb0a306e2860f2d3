"""Scores of a set of primitives: bits and scores on the objective's samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ...kernels.field.bounds import extents
from ...kernels.field.combine import fold
from ...kernels.field.evaluate import primitives_at
from ...kernels.field.points import PointBlocks
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.rows import BLEND
from ...kernels.select.blend_search import BlendTrials
from ...kernels.select.objective_sums import Sums, objective
from .objective import Score, Tally

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


def choose_blends(values: np.ndarray, rows: np.ndarray, tally: Tally, device: wp.Device) -> np.ndarray:
    """Rows with each blend set, in turn, to the choice that scores best while all others stay.

    Args:
        values: (primitive_count, n) distances at the samples.
        rows: (primitive_count, ROW).
        tally: the objective's sums.
        device: where the choices are tried.
    """
    rows = rows.copy()
    blends = rows[:, BLEND]
    union = fold(values, blends)
    bare = (values.min(0) >= 0) & tally.box
    held = np.array(Sums(*tally.sums(union < 0), twice=0.0, bare=(bare & (union < 0)).sum()))
    # A blend moves a surface by a quarter of itself at most.
    near = np.flatnonzero(np.abs(union) < max(BLEND_CHOICES[-1], float(blends.max(initial=0.0))))
    if not len(near):
        blends[1:] = 0.0
        return rows
    trials = BlendTrials(
        values[:, near],
        blends,
        BLEND_CHOICES[-1],
        len(BLEND_CHOICES) + 1,
        tally.kind[near],
        tally.weight[near],
        bare[near],
        device,
    )
    # Blends change neither the number of primitives nor their overlaps.
    prices = tally.prices(0.0)
    for k in range(1, len(rows)):
        choices = np.append(np.array(BLEND_CHOICES, np.float32), blends[k])
        sums = trials.sums_of(k, choices)
        sums += held - sums[-1]
        scores = objective(Sums(*sums.T), 0, prices)
        # A blend must earn its place: no smooth joint where a plain one is as good.
        scores -= np.where(choices > 0, 1e-5, 0.0)
        best = int(np.argmax(scores))
        held, blends[k] = sums[best], choices[best]
        trials.blends.host[k] = blends[k]
    return rows


def rough_volume(rows: np.ndarray, families: Sequence[str]) -> np.ndarray:
    """Volumes of the primitives' boxes, to order them by."""
    return extents(rows, families).prod(1)


def sorted_by_volume(pool: np.ndarray, families: Sequence[str], chosen: list[int]) -> np.ndarray:
    """The chosen indices, biggest primitive first: the order that the union folds in."""
    index = np.array(chosen)
    return index[np.argsort(-rough_volume(pool[index], [families[place] for place in chosen]), kind="stable")]
