"""Triangle mesh of one primitive alone, however thin.

It is sampled in its own frame on a grid fitted to it. A bent primitive is meshed straight and its vertices are bent:
the field is that of the straight form at the straightened point, so this is the same surface.
"""

from __future__ import annotations

import math

import numpy as np

from ..field.bounds import local_bounds, parameter_value, rotation_matrices
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
NARROWEST_TOP = 0.5
"""Walls that taper off are followed down to this share of their width at the bottom."""
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
    theta = 0.0
    if _can_be_bent_afterwards(entry, shape):
        theta = 0.5 * math.pi * parameter_value(entry, shape, "bulge", 0.0)
        shape[entry.columns("bulge")] = 0.0
    alone = PrimitiveSet(row, [entry.name], primitives.device)
    lower, upper = local_bounds(entry, shape)
    side = np.maximum(upper - lower, 1e-6)
    cells = _grid_cells(entry, shape, side, resolution)
    spacing = side / cells
    origin = lower - BORDER * spacing
    counts = np.ceil(cells + 2 * BORDER).astype(int) + 1
    axes = [origin[axis] + spacing[axis] * np.arange(counts[axis]) for axis in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    samples = evaluate_assembly(alone, grid.reshape(-1, 3)).reshape(grid.shape[:3])
    vertices, faces = contour_samples(alone, samples, origin, spacing)
    if theta:
        vertices = _bend_points(vertices, 0.5 * max(float(shape[2]), 1e-6), theta)
    return (vertices @ turn.T + centre).astype(np.float32), faces


def _can_be_bent_afterwards(entry: Family, shape: np.ndarray) -> bool:
    """Whether a primitive is bent, and its profile stays clear of the arc's centre, so that bending can be undone."""
    theta = 0.5 * math.pi * abs(parameter_value(entry, shape, "bulge", 0.0))
    if theta == 0.0:
        return False
    straight = shape.copy()
    straight[entry.columns("bulge")] = 0.0
    radius = 0.5 * max(float(shape[entry.columns("size")][2]), 1e-6) / math.sin(theta)
    return bool(local_bounds(entry, straight)[1][0] < 0.98 * radius)


def _bend_points(points: np.ndarray, half_height: float, theta: float) -> np.ndarray:
    """Bend straight points (n, 3): the inverse of `bend.straighten`.

    The axis from (0, -h) to (0, h) becomes an arc of half angle `theta`, its apex towards -x for theta above 0; what
    lies beyond its ends goes straight on.
    """
    x, y, z = np.asarray(points, np.float64).T
    # `straighten` mirrors x, which the even profile does not see; here it would turn the faces inside out.
    radius = half_height / math.sin(theta)
    centre = radius * math.cos(theta)
    angle = theta * np.clip(z / half_height, -1.0, 1.0)
    beyond = z - np.clip(z, -half_height, half_height)
    bent_x = centre - (radius - x) * np.cos(angle) + beyond * np.sin(angle)
    bent_z = (radius - x) * np.sin(angle) + beyond * np.cos(angle)
    return np.stack([bent_x, y, bent_z], axis=1)


def _grid_cells(entry: Family, shape: np.ndarray, side: np.ndarray, resolution: int) -> np.ndarray:
    """Cells (3,) along the sides (3,) of a primitive's box: enough for its thinnest wall, within the limits."""
    size = np.maximum(shape[entry.columns("size")].astype(np.float64), 1e-6)
    dilation = parameter_value(entry, shape, "dilation", 0.0)
    onion = parameter_value(entry, shape, "onion", -1.0)
    taper = parameter_value(entry, shape, "taper", 1.0)
    thin = size + 2.0 * dilation
    if onion > 0.0:
        wall = 0.5 * float(size[:2].min()) * (1.0 - onion) * min(max(taper, NARROWEST_TOP), 1.0)
        thin[:2] = np.minimum(thin[:2], wall + 2.0 * dilation)
    if parameter_value(entry, shape, "bulge", 0.0) != 0.0:
        thin[[0, 2]] = thin[[0, 2]].min()
    # A wall of no width (onion 1, no dilation) has no inside to find, and must not divide by zero.
    thin = np.maximum(thin, 1e-6)
    cells = np.clip(resolution * side / side.max(), min(SHORT_SIDE_CELLS, resolution), resolution)
    cells = np.clip(np.maximum(cells, WALL_CELLS * side / thin), None, max(MAX_CELLS, resolution))
    cells *= min(1.0, (MAX_POINTS / float(cells.prod())) ** (1 / 3))
    return np.maximum(np.round(cells), 2.0)
