"""How thick a solid is under points of its surface."""

from __future__ import annotations

import numpy as np
import warp as wp

from .solid_query import SolidQuery

START = 1.0e-4
"""How far under the surface a ray starts, so that it does not hit the face that it comes from."""


def local_thickness(query: SolidQuery, points: np.ndarray) -> np.ndarray:
    """Length of the way straight into the solid until it is left.

    Args:
        query: the solid.
        points: (n, 3), normalised, on or near the surface.

    Returns:
        (n,) float32, normalised; the thickness of the sheets for points on one.
    """
    located = query.locate(points)
    thickness = np.full(len(located.face), query.solid.thickness, np.float32)
    chosen = np.flatnonzero(~located.on_sheet & (located.face >= 0))
    if not len(chosen) or query.boundary is None:
        return thickness
    corners = query.solid.vertices[query.solid.boundary_faces[located.face[chosen]]]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inwards = -cross / np.maximum(np.linalg.norm(cross, axis=1), 1e-30)[:, None]
    origins = located.nearest[chosen] + START * inwards
    hits = query.boundary.cast_rays(
        wp.array(np.ascontiguousarray(origins, np.float32), dtype=wp.vec3, device=query.device),
        wp.array(np.ascontiguousarray(inwards, np.float32), dtype=wp.vec3, device=query.device),
    )
    length = hits.distance.numpy() + np.float32(START)
    # A ray that slips out between two faces says nothing; no way inside is longer than the box's diagonal.
    thickness[chosen] = np.minimum(length, np.float32(2.0 * np.sqrt(3.0)))
    return thickness
