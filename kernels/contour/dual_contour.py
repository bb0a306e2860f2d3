"""Dual contouring: a closed triangle mesh of a field's zero set that keeps sharp edges.

One vertex per patch of surface in a grid cell (see `cell_patches`), where it fits the tangent planes at the crossed
edges best (Ju et al. 2002), and one quad per crossed edge. Crossings, normals and the final projection come from the
field itself, not from interpolated samples.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from .dual_contour_grid import AROUND, Cells, Crossings, SampledField, find_cells, find_crossings, pair_faces
from .dual_contour_topology import edge
from .dual_contour_vertices import place_vertices, project_vertices, refine_crossings

TURNED_COST = 0.05
"""What a triangle that faces the wrong way is worth in cells of distance, when quads are split."""


def dual_contour(field: SampledField, device: wp.Device) -> tuple[np.ndarray, np.ndarray]:
    """Mesh the zero set of a field.

    Returns:
        vertices (v, 3) float32 and faces (f, 3) int32, counter-clockwise seen from outside; none without a crossing.
    """
    inside = field.samples < 0.0
    crossings = find_crossings(inside)
    if not len(crossings.axis):
        return np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32)
    cells = find_cells(inside, crossings)
    edge_patch, counts = pair_faces(field, cells)
    positions, normals = refine_crossings(field, crossings)
    vertices, first_vertex = place_vertices(cells, edge_patch, counts, positions, normals, device)
    vertices = project_vertices(field, vertices, np.repeat(cells.corner, counts, axis=0))
    quads = _join_quads(crossings, cells, edge_patch, first_vertex)
    faces = _split_quads(field, vertices, quads, normals)
    return field.points(vertices), faces


def _join_quads(
    crossings: Crossings, cells: Cells, edge_patch: np.ndarray, first_vertex: np.ndarray
) -> np.ndarray:
    """Quads (n, 4) of vertex indices around each crossing, counter-clockwise seen from outside."""
    quads = np.empty((len(crossings.axis), 4), np.int64)
    for slot, (a, b) in enumerate(AROUND):
        cell = cells.of_crossing[:, slot]
        quads[:, slot] = first_vertex[cell] + edge_patch[cell, edge(0, a, b) + 4 * crossings.axis]
    return np.where(crossings.starts_inside[:, None], quads, quads[:, ::-1])


def _split_quads(
    field: SampledField, vertices: np.ndarray, quads: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """Triangles (2 n, 3) int32 of the quads (n, 4).

    Each takes the diagonal whose middle lies nearer to the surface, unless a triangle then looks away from the normal
    at the crossing (n, 3); the shorter diagonal on a tie.
    """
    corners = vertices[quads]
    middles = 0.5 * np.concatenate([corners[:, 0] + corners[:, 2], corners[:, 1] + corners[:, 3]])
    cell = float(field.spacing.min())
    cost = np.abs(field.evaluate(field.points(middles))).reshape(2, -1) / cell
    splits = np.array([[[0, 1, 2], [0, 2, 3]], [[1, 2, 3], [1, 3, 0]]])
    for split, triangles in enumerate(splits):
        cost[split] += 1e-3 * np.linalg.norm(
            corners[:, triangles[0, 0]] - corners[:, triangles[0, 2]], axis=1
        )
        for a, b, c in triangles:
            across = np.cross(corners[:, b] - corners[:, a], corners[:, c] - corners[:, a])
            cost[split] += TURNED_COST * ((across * normals).sum(axis=1) < 0.0)
    best = splits[(cost[0] > cost[1]).astype(int)]
    return np.take_along_axis(quads[:, None, :], best, axis=2).reshape(-1, 3).astype(np.int32)
