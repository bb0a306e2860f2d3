"""Triangle mesh of an assembly's smooth union."""

from __future__ import annotations

import numpy as np

from ..field.bounds import assembly_bounds, steepest_slope
from ..field.evaluate import evaluate_assembly, evaluate_grid
from ..field.gradient import evaluate_gradient
from ..field.primitive_set import PrimitiveSet
from .dual_contour import dual_contour
from .dual_contour_grid import SampledField

Surface = tuple[np.ndarray, np.ndarray]

BORDER = 2.37
"""Cells between the surface and the grid's border: whole ones would put symmetric surfaces onto grid points."""
COARSE = (32, 48)
"""Cells along the longest side of the grids that tighten loose bounds, one after the other."""
MAX_ENLARGEMENTS = 6
"""Times that a grid which the surface leaves is enlarged."""
MAX_GROWTH = 8.0
"""Points of an enlarged grid over those of a cube of the resolution: a field of numbers that are too large for single
precision may be negative everywhere."""


def extract_isosurface(
    primitives: PrimitiveSet, resolution: int = 128, bounds: tuple[np.ndarray, np.ndarray] | None = None
) -> Surface:
    """Closed mesh of the smooth union, sharp edges kept.

    Parts and gaps thinner than a cell may be lost; what is left is closed all the same.

    Args:
        primitives: the assembly, gates included.
        resolution: cells along the longest side of the bounds.
        bounds: lowest and highest corner of the surface, where they are known; enlarged where it leaves them.

    Returns:
        vertices (v, 3) float32, normalised frame, and faces (f, 3) int32, counter-clockwise seen from outside.
    """
    if resolution < 2:
        raise ValueError(f"resolution is {resolution}; it must be at least 2")
    if bounds is None:
        lower, upper = tight_bounds(primitives)
    else:
        lower, upper = np.asarray(bounds[0], np.float64), np.asarray(bounds[1], np.float64)
    if not (upper > lower).all():
        return np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32)
    spacing = float((upper - lower).max()) / resolution
    low_cells, high_cells = np.full(3, BORDER), np.full(3, BORDER)
    for attempt in range(MAX_ENLARGEMENTS + 1):
        origin = lower - low_cells * spacing
        samples = _sample(primitives, origin, upper + high_cells * spacing, spacing)
        touched = [samples.take(side, axis).min() < 0.0 for axis in range(3) for side in (0, -1)]
        if not any(touched) or attempt == MAX_ENLARGEMENTS or samples.size > MAX_GROWTH * resolution**3:
            return contour_samples(primitives, samples, origin, np.full(3, spacing))
        low_cells += np.array(touched[0::2]) * 0.25 * resolution
        high_cells += np.array(touched[1::2]) * 0.25 * resolution
    raise AssertionError("the last attempt returns")


def _sample(primitives: PrimitiveSet, lower: np.ndarray, upper: np.ndarray, spacing: float) -> np.ndarray:
    """The union at points `spacing` apart from `lower` to `upper` or just beyond."""
    nx, ny, nz = (int(count) for count in np.ceil((upper - lower) / spacing) + 1)
    x, y, z = (float(coordinate) for coordinate in lower)
    return evaluate_grid(primitives, (nx, ny, nz), (x, y, z), spacing)


def contour_samples(
    primitives: PrimitiveSet, samples: np.ndarray, lower: np.ndarray, spacing: np.ndarray
) -> Surface:
    """Mesh of the union from its samples at the points lower + spacing * (i, j, k), normalised frame.

    Whatever reaches the grid's border is cut there, so that the mesh is closed in any case.
    """
    for axis in range(3):
        for side in (0, -1):
            border: list[slice | int] = [slice(None)] * 3
            border[axis] = side
            samples[tuple(border)] = np.maximum(samples[tuple(border)], 1e-6)
    field = SampledField(
        samples,
        lower,
        spacing,
        lambda points: evaluate_assembly(primitives, points),
        lambda points: evaluate_gradient(primitives, points),
    )
    return dual_contour(field, primitives.device)


def tight_bounds(primitives: PrimitiveSet) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner (3,) of the union's surface, to a cell of a coarse grid.

    The field may not be trusted far from it for families with an approximate one: then the parts' boxes stay.
    """
    lower, upper = assembly_bounds(primitives)
    if not (upper > lower).all() or any(run.family.approximate for run in primitives.runs):
        return lower, upper
    slope = steepest_slope(primitives)
    for cells in COARSE:
        spacing = float((upper - lower).max()) / cells
        samples = _sample(primitives, lower + 0.5 * spacing, upper + 0.5 * spacing, spacing)
        near = samples < slope * 0.5 * np.sqrt(3.0) * spacing
        if not near.any():
            break
        start, end = lower.copy(), upper
        for axis in range(3):
            where = np.flatnonzero(near.any(axis=tuple(other for other in range(3) if other != axis)))
            lower[axis] = start[axis] + where[0] * spacing
            upper[axis] = min(end[axis], start[axis] + (where[-1] + 1) * spacing)
    return lower, upper
