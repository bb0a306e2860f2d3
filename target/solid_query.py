"""Exact signed distances to a solid at any points, by queries of its faces."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..kernels.mesh_probe import winding_numbers
from ..kernels.mesh_query import MeshQuery
from .solid import Solid

SIGN_SLACK = 1.0e-5
"""Added to half a cell's diagonal before the sign of a cell's centre is believed, for float32's rounding."""


class SolidQuery:
    """A solid on a device, ready for queries.

    Attributes:
        solid, device: what was given.
        winding: query of the faces that tell inside from outside; None if the solid is sheets only.
        boundary: query of the faces that distances are to; the same object where they are the same.
        sheets: query of the sheets' faces; None if there are none.
        inside: (n, n, n) bool, whether the cell centres of [-1, 1]^3 are inside `winding`; None until the grid
            is made. It spares winding numbers for points further from the surface than their cell is wide.
    """

    def __init__(self, solid: Solid, device: wp.Device) -> None:
        """Build the hierarchies (18 ms for 40 000 faces on one core)."""
        self.solid, self.device = solid, device
        self.winding = self.boundary = self.sheets = None
        if len(solid.winding_faces):
            self.winding = MeshQuery(solid.vertices, solid.winding_faces, device)
            self.boundary = self.winding
            if solid.boundary_faces is not solid.winding_faces:
                self.boundary = MeshQuery(solid.vertices, solid.boundary_faces, device)
        if len(solid.sheet_faces):
            self.sheets = MeshQuery(solid.vertices, solid.sheet_faces, device)
        self.inside: np.ndarray | None = None

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        """Distance to the surface at points (n, 3), normalised, negative inside; (n,) float32.

        Exact but where sheets meet the rest: there the nearer of the two surfaces counts, also inside.
        """
        points = np.ascontiguousarray(points, np.float32)
        distance = np.full(len(points), np.inf, np.float32)
        if not len(points):
            return distance
        queries = wp.array(points, dtype=wp.vec3, device=self.device)
        if self.boundary is not None:
            distance = self.boundary.closest_points(queries).distance.numpy()
            distance = np.where(self._inside(points, distance), -distance, distance)
        if self.sheets is not None:
            sheet = self.sheets.closest_points(queries).distance.numpy()
            distance = np.minimum(distance, sheet - np.float32(0.5 * self.solid.thickness))
        return distance.astype(np.float32)

    def _inside(self, points: np.ndarray, distance: np.ndarray) -> np.ndarray:
        """Whether the points are inside the winding faces, given their distance from the boundary."""
        inside = np.zeros(len(points), bool)
        ask = np.ones(len(points), bool)
        if self.inside is not None:
            resolution = len(self.inside)
            cell = np.floor((points + 1.0) * (0.5 * resolution)).astype(np.int64)
            within = ((cell >= 0) & (cell < resolution)).all(axis=1)
            cell = np.clip(cell, 0, resolution - 1)
            inside = self.inside[cell[:, 0], cell[:, 1], cell[:, 2]]
            # No surface lies between such a point and the centre of its cell.
            ask = ~(within & (distance > np.sqrt(3.0) / resolution + SIGN_SLACK))
        if ask.any() and self.winding is not None:
            asked = wp.array(np.ascontiguousarray(points[ask]), dtype=wp.vec3, device=self.device)
            inside[ask] = winding_numbers(self.winding, asked).numpy() > 0.5
        return inside
