"""Boxes around primitives and assemblies, from their parameters: where a grid or a ray has to look.

The box of one primitive is exact but for bent forms, where it is a little too large. Families share the names of
their parameters: `size` is the full extent before `dilation`; `taper` above 1 widens the top; `bulge` bends.
"""

from __future__ import annotations

import math

import numpy as np

from ..primitives import family
from ..primitives.family import Family
from ..rotation import matrix_of
from ..rows import BLEND, GATE, ROTATION, SHAPE, SHAPES, TRANSLATION
from .primitive_set import PrimitiveSet


def parameter_value(entry: Family, shape: np.ndarray, name: str, otherwise: float) -> float:
    """The scalar parameter `name` of a shape (SHAPE,), or `otherwise` where the family has none of that name."""
    if all(parameter.name != name for parameter in entry.parameters):
        return otherwise
    return float(shape[entry.columns(name)][0])


def local_bounds(entry: Family, shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Box around a primitive's surface in its local frame.

    Args:
        entry: the family, which says what the numbers mean.
        shape: (SHAPE,), its parameters.

    Returns:
        Lowest and highest corner, each (3,) float64, normalised units.
    """
    size = np.maximum(np.asarray(shape[entry.columns("size")], np.float64), 1e-6)
    dilation = parameter_value(entry, shape, "dilation", 0.0)
    taper = parameter_value(entry, shape, "taper", 1.0)
    theta = 0.5 * math.pi * parameter_value(entry, shape, "bulge", 0.0)
    half = 0.5 * size
    half[:2] += max(taper - 1.0, 0.0) * half[:2].min()
    low, high = -half, half.copy()
    if theta != 0.0:
        # The axis is an arc through (0, +-h) with its apex at x = -h tan(theta / 2); the profile stands across it.
        bend, x, h = abs(theta), half[0], half[2]
        low[0] = -h * math.tan(0.5 * bend) - x
        high[0] = x * max(math.cos(bend), 0.0)
        high[2] = h + x * math.sin(bend)
        low[2] = -high[2]
        if theta < 0.0:
            low[0], high[0] = -high[0], -low[0]
    return low - dilation, high + dilation


def has_bent(primitives: PrimitiveSet) -> bool:
    """Whether a primitive is bent enough for its field to be steeper than a distance."""
    rows = primitives.rows_numpy()
    return any(
        abs(parameter_value(family(name), row[SHAPES : SHAPES + SHAPE], "bulge", 0.0)) > 1e-3
        for name, row in zip(primitives.families, rows, strict=True)
    )


def rotation_matrices(rows: np.ndarray) -> np.ndarray:
    """Local-to-world rotations (primitive_count, 3, 3) of rows (primitive_count, ROW)."""
    return matrix_of(rows[:, ROTATION : ROTATION + 4].astype(np.float64))


def primitive_bounds(primitives: PrimitiveSet) -> np.ndarray:
    """Axis-parallel boxes (primitive_count, 2, 3) float64 around each primitive alone, normalised frame."""
    rows = primitives.rows_numpy()
    boxes = np.zeros((len(rows), 2, 3))
    for k, (row, turn) in enumerate(zip(rows, rotation_matrices(rows), strict=True)):
        low, high = local_bounds(family(primitives.families[k]), row[SHAPES : SHAPES + SHAPE])
        middle = turn @ (0.5 * (low + high)) + row[TRANSLATION : TRANSLATION + 3]
        reach = np.abs(turn) @ (0.5 * (high - low))
        boxes[k] = middle - reach, middle + reach
    return boxes


def assembly_bounds(primitives: PrimitiveSet) -> tuple[np.ndarray, np.ndarray]:
    """Box that holds the surface of the smooth union, joins included.

    Returns:
        Lowest and highest corner, each (3,) float64, normalised frame; both 0 for an empty assembly.
    """
    rows = primitives.rows_numpy()
    there = rows[:, GATE] > 0.0
    if not there.any():
        return np.zeros(3), np.zeros(3)
    boxes = primitive_bounds(primitives)[there]
    # A smooth minimum lies at most a quarter of its blend below the smaller of the two.
    swell = 0.25 * float(np.maximum(rows[there, BLEND][1:], 0.0).sum())
    return boxes[:, 0].min(axis=0) - swell, boxes[:, 1].max(axis=0) + swell
