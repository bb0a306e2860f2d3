"""Exact signed distances to a solid at any points, by queries of its faces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from ..kernels.mesh_probe import look_at_cells, winding_numbers
from ..kernels.mesh_query import MeshQuery
from ..kernels.mesh_sign import classify_cells

if TYPE_CHECKING:
    from .solid import Solid

CELL_RESOLUTION = 128
"""Cells along a side of [-1, 1]^3 whose inside is settled once, so that most points need no winding number."""


class WindingQuery:
    """What some faces wind round, ready for queries.

    Attributes:
        mesh: query of the faces.
        inside: (n, n, n) bool on the device: whether they wind round the cell centres of [-1, 1]^3 more than
            half a time, n = CELL_RESOLUTION.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, device: wp.Device) -> None:
        """Settle the cells of vertices (n, 3), normalised, and faces (m, 3), m > 0."""
        self.mesh = MeshQuery(vertices, faces, device)
        self.inside = classify_cells(self.mesh, CELL_RESOLUTION)[0]

    def contains(self, points: np.ndarray) -> np.ndarray:
        """Whether the faces wind round points (n, 3), normalised, more than half a time; (n,) bool."""
        points = np.ascontiguousarray(points, np.float32)
        device = self.mesh.device
        asked = wp.array(points, dtype=wp.vec3, device=device)
        found = look_at_cells(self.mesh, asked, self.inside).numpy()
        unseen = found < 0
        if unseen.any():
            rest = wp.array(np.ascontiguousarray(points[unseen]), dtype=wp.vec3, device=device)
            found[unseen] = winding_numbers(self.mesh, rest).numpy() > 0.5
        return found == 1


class SolidQuery:
    """A solid on a device, ready for queries.

    Attributes:
        solid, device: what was given.
        winding: query of the faces that tell inside from outside; None if the solid is sheets only.
        boundary: query of the faces that distances are to; None in the same case.
        sheets: query of the sheets' faces; None if there are none.
    """

    def __init__(self, solid: Solid, device: wp.Device, winding: WindingQuery | None = None) -> None:
        """Build the hierarchies (18 ms for 40 000 faces on one core), but for that of `winding`, if given."""
        self.solid, self.device = solid, device
        self.winding, self.boundary, self.sheets = winding, None, None
        if len(solid.winding_faces):
            self.winding = winding or WindingQuery(solid.vertices, solid.winding_faces, device)
            self.boundary = self.winding.mesh
            if solid.boundary_faces is not solid.winding_faces:
                self.boundary = MeshQuery(solid.vertices, solid.boundary_faces, device)
        if len(solid.sheet_faces):
            self.sheets = MeshQuery(solid.vertices, solid.sheet_faces, device)

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        """Distance to the surface at points (n, 3), normalised, negative inside; (n,) float32.

        Exact but where sheets meet the rest: there the nearer of the two surfaces counts, also inside.
        """
        points = np.ascontiguousarray(points, np.float32)
        distance = np.full(len(points), np.inf, np.float32)
        if not len(points):
            return distance
        queries = wp.array(points, dtype=wp.vec3, device=self.device)
        if self.boundary is not None and self.winding is not None:
            distance = self.boundary.closest_points(queries).distance.numpy()
            distance = np.where(self.winding.contains(points), -distance, distance)
        if self.sheets is not None:
            sheet = self.sheets.closest_points(queries).distance.numpy()
            distance = np.minimum(distance, sheet - np.float32(0.5 * self.solid.thickness))
        return distance.astype(np.float32)
