"""Deciding what the solid of a mesh is, and saying it in one sentence.

Everything is in the normalised frame (bounding box centred, longest side 1.8) unless a name says otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from .bodies import Bodies, sort_bodies


@dataclass(frozen=True)
class Solid:
    """A solid: the inside of some faces, and sheets of some thickness.

    A point is inside where `winding_faces` wind round it more than half a time, or nearer to `sheet_faces` than
    half of `thickness`.
    """

    kind: str
    """closed, flipped, reoriented, union, winding, shell or mixed."""
    sentence: str
    """What was found and done, for people; lengths in mesh units."""
    vertices: np.ndarray
    """(n, 3) float32, normalised."""
    winding_faces: np.ndarray
    """(m, 3) int32, counter-clockwise seen from outside."""
    boundary_faces: np.ndarray
    """(k, 3) int32: those of them that are on the surface of the solid; distances are to these."""
    sheet_faces: np.ndarray
    """(s, 3) int32: faces that enclose nothing."""
    thickness: float
    """Of the sheets, normalised; 0 if there are none."""


def decide_solid(vertices: np.ndarray, faces: np.ndarray, scale: float, device: wp.Device) -> Solid:
    """What the solid of a welded mesh is.

    Args:
        vertices: (n, 3) float64, normalised. faces: (m, 3) int, m > 0.
        scale: mesh units per normalised unit, for the sentence.
        device: where to compute.
    """
    bodies = sort_bodies(vertices, faces, device)
    winding = bodies.faces[bodies.closed | bodies.open].astype(np.int32)
    kind, sentence = _describe(bodies)
    return Solid(
        kind, sentence, vertices.astype(np.float32), winding, winding, np.zeros((0, 3), np.int32), 0.0
    )


def _describe(bodies: Bodies) -> tuple[str, str]:
    if bodies.open.any():
        return "winding", "open mesh; inside is where it winds round a point more than half a time."
    if bodies.turned_count:
        return (
            "reoriented",
            f"closed mesh with {bodies.turned_count} faces turned the wrong way; turned back.",
        )
    if bodies.inverted_count:
        return "flipped", "closed mesh that was inside out; turned outwards."
    return "closed", "closed, consistently wound mesh; taken as it is."
