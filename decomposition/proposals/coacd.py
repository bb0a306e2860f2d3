"""Regions by approximate convex decomposition (CoACD): the other way to cut a residual, for comparison.

Convex pieces over-partition what one bent or hollow primitive can be, and cuts follow the axes; the option exists to
measure that. Needs the optional package `coacd` (extra `compare`).
"""

from __future__ import annotations

from importlib import import_module

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from resfit.errors import InputError
from resfit.extras import command_for

from ..region import Region, region_from_mask
from .proposal import Proposal, Unexplained

THRESHOLD = 0.05
"""CoACD's concavity at which a piece is convex enough: its own default."""
COARSE_FROM, COARSE_STEP = 24, 3
"""Residuals of more cells a side than this are meshed in steps of so many cells: CoACD takes minutes on fine meshes."""
SMALLEST = 12
"""Cells of the smallest region that is worth a primitive."""


def convex_parts(unexplained: Unexplained) -> list[Region]:
    """The residual's cells, cut into nearly convex regions with source "coacd".

    Raises:
        InputError: if the package is not installed.
    """
    residual = unexplained.residual
    solid = residual.depth > 0.0
    cells = np.argwhere(solid)
    regions = []
    for hull in _convex_pieces(residual.depth, unexplained.seed):
        inside = _cells_in_hull(hull, cells)
        mask = np.zeros(solid.shape, bool)
        mask[tuple(cells[inside].T)] = True
        region = region_from_mask(mask, residual.lower, residual.resolution, "coacd")
        if region is not None and region.volume >= SMALLEST:
            regions.append(region)
    return regions


def _convex_pieces(depth: np.ndarray, seed: int) -> list[np.ndarray]:
    """Vertices of the pieces' hulls, in cells of the residual's box."""
    try:
        # By its name: to type checkers, which look beside the file first, `import coacd` is this module.
        coacd = import_module("coacd")
    except ImportError as error:
        raise InputError(
            "--decompose coacd needs the package coacd, which is not installed; call"
            f" {command_for('compare')} to get it."
        ) from error
    from skimage.measure import marching_cubes

    # A border of outside cells closes the surface; clipping keeps far cells from flattening it.
    padded = np.pad(np.clip(depth, -1.0, 1.0), 1, constant_values=-1.0)
    step = COARSE_STEP if min(depth.shape) > COARSE_FROM else 1
    vertices, faces, _, _ = marching_cubes(padded, 0.0, step_size=step)
    coacd.set_log_level("error")
    mesh = coacd.Mesh(vertices.astype(np.float64) - 1.0, faces[:, ::-1].astype(np.int32))
    pieces = coacd.run_coacd(mesh, threshold=THRESHOLD, preprocess_mode="off", seed=seed)
    return [np.asarray(points, np.float64) for points, _ in pieces]


def _cells_in_hull(hull: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Containment of cells (m, 3) in the convex hull of points, with half a cell to spare."""
    if len(hull) < 4:
        return np.zeros(len(cells), bool)
    try:
        planes = ConvexHull(hull).equations
    except QhullError:
        return np.zeros(len(cells), bool)
    return np.asarray((cells @ planes[:, :3].T + planes[:, 3] < 0.5).all(1))


PROPOSAL = Proposal(name="coacd", find=convex_parts, alone=True)
