"""Balls, capsules and rings: shapes without extent that dilation makes thick. Lengths are normalised."""

from __future__ import annotations

import numpy as np

from .parameters import ParameterTable

Turned = tuple[np.ndarray, tuple[int, int, int] | None]
"""A shape (SHAPE,), and which of the old axes its x, y and z are; None where they stay."""

THIN = 0.08
"""A size below this share of the dilation may be none."""
SLENDER = 10.0
"""A capsule longer than this many radii may be a rod with flat ends, which are too small to have been told apart."""
NEARLY_ONE = 0.99
"""Onion above which a wall is none, where dilation makes it thick."""


def without_extent(family: ParameterTable, shape: np.ndarray) -> Turned:
    """A shape (SHAPE,) whose thin sizes, and a thin wall, are none: dilation takes their place.

    Returns:
        The shape, and which of the old axes its x, y and z are; None where they stay.
    """
    dilation = family.value(shape, "dilation", 0.0)
    if dilation <= 0.0:
        return shape, None
    sizes = shape[family.columns("size")].astype(np.float64)
    thin = sizes < THIN * dilation
    onion = family.value(shape, "onion", -1.0)
    if onion > NEARLY_ONE and not thin[:2].any():
        # A ring: half the wall's thickness goes inwards, half outwards.
        wall = 0.5 * min(sizes[0], sizes[1]) * (1.0 - onion)
        grown = 0.25 * (wall + sizes[2]) if thin[2] else 0.5 * wall
        changed = family.with_values(shape, {"onion": 1.0, "dilation": dilation + grown})
        height = 0.0 if thin[2] else sizes[2] - wall
        changed[family.columns("size")] = (*(sizes[:2] - wall), height)
        return changed, None
    if thin.sum() < 2:
        return shape, None
    # A ball or a capsule: what is left is at most one length, which becomes the sweep.
    grown = 0.5 * float(sizes[thin].mean())
    length = 0.0 if thin.all() else float(sizes.max()) - 2.0 * grown
    axis = int(np.argmax(sizes))
    size = (0.0, 0.0, max(length, 0.0))
    changed = family.shape_row(size=size, dilation=dilation + grown, roundness=1.0)
    return changed, None if thin.all() else ((axis + 1) % 3, (axis + 2) % 3, axis)


def flat_ended(family: ParameterTable, shape: np.ndarray) -> np.ndarray:
    """The cylinder that is as long and as thick as a capsule: a thin rod ends as one or the other."""
    dilation = family.value(shape, "dilation", 0.0)
    width, depth, length = shape[family.columns("size")].tolist()
    if dilation <= 0.0 or width > 0.0 or depth > 0.0 or length < SLENDER * dilation:
        return shape
    size = (2.0 * dilation, 2.0 * dilation, length + 2.0 * dilation)
    return family.shape_row(size=size, roundness=1.0)
