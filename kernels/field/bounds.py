"""Boxes around primitives and assemblies, from their parameters: where a grid or a ray has to look.

Each family says what its own box is; here the boxes are turned, and those of an assembly joined.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..primitives import family
from ..primitives.family import Family
from ..rotation import matrix_of
from ..rows import BLEND, GATE, ROTATION, SHAPE, SHAPES, TRANSLATION
from .primitive_set import PrimitiveSet


def steepest_slope(primitives: PrimitiveSet) -> float:
    """Lipschitz constant of the union's field, but for few points: 1 where all are distances."""
    return max((entry.slope(shape) for entry, shape in _shapes(primitives)), default=1.0)


def safe_step(primitives: PrimitiveSet) -> float:
    """Share of the union's field after which, but for few points, a ray is before the surface or inside."""
    return min((entry.step(shape) for entry, shape in _shapes(primitives)), default=1.0)


def extents(rows: np.ndarray, families: Sequence[str]) -> np.ndarray:
    """Extents (primitive_count, 3) float32 of rows (primitive_count, ROW) along their own axes."""
    found = np.zeros((len(rows), 3), np.float32)
    names = np.asarray(families, object)
    for name in dict.fromkeys(families):
        own = names == name
        found[own] = family(name).extents(rows[own, SHAPES : SHAPES + SHAPE])
    return found


def _shapes(primitives: PrimitiveSet) -> Iterator[tuple[Family, np.ndarray]]:
    for name, row in zip(primitives.families, primitives.rows_numpy(), strict=True):
        yield family(name), row[SHAPES : SHAPES + SHAPE]


def rotation_matrices(rows: np.ndarray) -> np.ndarray:
    """Local-to-world rotations (primitive_count, 3, 3) of rows (primitive_count, ROW)."""
    return matrix_of(rows[:, ROTATION : ROTATION + 4].astype(np.float64))


def primitive_bounds(primitives: PrimitiveSet) -> np.ndarray:
    """Axis-parallel boxes (primitive_count, 2, 3) float64 around each primitive alone, normalised frame."""
    rows = primitives.rows_numpy()
    boxes = np.zeros((len(rows), 2, 3))
    for k, (row, turn) in enumerate(zip(rows, rotation_matrices(rows), strict=True)):
        low, high = family(primitives.families[k]).bounds(row[SHAPES : SHAPES + SHAPE])
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
