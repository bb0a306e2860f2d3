"""Triangle mesh of one primitive alone, however thin.

It is sampled in its own frame on a grid fitted to it. Where its family knows a simpler shape and a map to it, as of a
bent bar that is meshed straight, that shape is meshed and its vertices are mapped.
"""

from __future__ import annotations

import numpy as np

from ..field.bounds import rotation_matrices
from ..field.evaluate import evaluate_assembly
from ..field.primitive_set import PrimitiveSet
from ..primitives import family
from ..primitives.family import Family
from ..rows import BLEND, GATE, ROTATION, SHAPE, SHAPES, TRANSLATION
from .isosurface import BORDER, Surface, contour_samples

SHORT_SIDE_CELLS = 16
"""Cells across the shortest side, unless the resolution is lower still."""
WALL_CELLS = 2.2
"""Cells across the thinnest wall: two always find it."""
MAX_CELLS = 288
MAX_POINTS = 1.2e7
"""Limits on the grid: hollow forms with thinner walls than these allow get holes."""


def part_isosurface(primitives: PrimitiveSet, index: int, resolution: int = 64) -> Surface:
    """Closed mesh of one primitive alone, ungated and unblended, sharp edges kept.

    Args:
        primitives: the assembly.
        index: which primitive.
        resolution: cells along its longest side; short sides and thin walls get finer ones.

    Returns:
        vertices (v, 3) float32, normalised frame, and faces (f, 3) int32, counter-clockwise seen from outside.
    """
    if resolution < 2:
        raise ValueError(f"resolution is {resolution}; it must be at least 2")
    row = primitives.rows_numpy()[index : index + 1]
    turn = rotation_matrices(row)[0]
    centre = row[0, TRANSLATION : TRANSLATION + 3].copy()
    row[0, TRANSLATION : TRANSLATION + 3] = 0.0
    row[0, ROTATION : ROTATION + 4] = 1.0, 0.0, 0.0, 0.0
    row[0, BLEND], row[0, GATE] = 0.0, 1.0
    entry = family(primitives.families[index])
    shape = row[0, SHAPES : SHAPES + SHAPE]
    straightened = entry.straightened(shape)
    if straightened is not None:
        shape[:] = straightened[0]
    alone = PrimitiveSet(row, [entry.name], primitives.device)
    lower, upper = entry.bounds(shape)
    side = np.maximum(upper - lower, 1e-6)
    cells = _grid_cells(entry, shape, side, resolution)
    spacing = side / cells
    origin = lower - BORDER * spacing
    counts = np.ceil(cells + 2 * BORDER).astype(int) + 1
    axes = [origin[axis] + spacing[axis] * np.arange(counts[axis]) for axis in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    samples = evaluate_assembly(alone, grid.reshape(-1, 3)).reshape(grid.shape[:3])
    vertices, faces = contour_samples(alone, samples, origin, spacing)
    if straightened is not None:
        vertices = straightened[1](vertices)
    return (vertices @ turn.T + centre).astype(np.float32), faces


def _grid_cells(entry: Family, shape: np.ndarray, side: np.ndarray, resolution: int) -> np.ndarray:
    """Cells (3,) along the sides (3,) of a primitive's box: enough for its thinnest wall, within the limits."""
    thin = side if entry.walls is None else entry.walls(shape)
    # A wall of no width (onion 1, no dilation) has no inside to find, and must not divide by zero.
    thin = np.maximum(thin, 1e-6)
    cells = np.clip(resolution * side / side.max(), min(SHORT_SIDE_CELLS, resolution), resolution)
    cells = np.clip(np.maximum(cells, WALL_CELLS * side / thin), None, max(MAX_CELLS, resolution))
    cells *= min(1.0, (MAX_POINTS / float(cells.prod())) ** (1 / 3))
    return np.maximum(np.round(cells), 2.0)
