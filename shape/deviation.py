"""Two-sided surface deviation between an assembly and its target."""

from __future__ import annotations

import numpy as np

from ..kernels.contour.isosurface import extract_isosurface
from ..kernels.field.evaluate import evaluate_assembly
from ..kernels.field.primitive_set import PrimitiveSet
from .target import Target


def surface_distances(target: Target, primitives: PrimitiveSet, resolution: int = 128) -> np.ndarray | None:
    """Distances between the surfaces of an assembly and its target.

    One way: the size of the assembly's field at the target's surface samples. The other way: the distance to the
    target of as many points on the assembly's isosurface.

    Args:
        target: what the assembly should match.
        primitives: the assembly, in the target's normalised frame.
        resolution: cells along the isosurface's longest side.

    Returns:
        (n,) float64, normalised units; None where the assembly has no surface.
    """
    if not len(primitives):
        return None
    vertices, faces = extract_isosurface(primitives, resolution)
    if not len(faces):
        return None
    surface = target.samples.surface.points
    there = np.abs(evaluate_assembly(primitives, surface))
    back = np.abs(target.query.signed_distance(sample_surface(vertices, faces, len(surface))))
    return np.concatenate([there, back]).astype(np.float64)


def sample_surface(vertices: np.ndarray, faces: np.ndarray, count: int, seed: int = 0) -> np.ndarray:
    """Points on a triangle mesh, evenly by area.

    Args:
        vertices, faces: (v, 3) and (f, 3), f > 0.
        count: of points.
        seed: equal seeds give equal points.

    Returns:
        (count, 3) float32, in the order of the faces.
    """
    rng = np.random.default_rng(seed)
    shares = (np.arange(count) + rng.uniform(size=count)) / max(count, 1)
    return surface_points(vertices, faces, shares, *rng.uniform(size=(2, count)))[0]


def surface_points(
    vertices: np.ndarray, faces: np.ndarray, shares: np.ndarray, u: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points on a triangle mesh by shares of its area.

    Args:
        vertices, faces: (v, 3) and (f, 3), f > 0.
        shares: (n,) in [0, 1], of the area of the faces up to the point's.
        u, v: (n,) in [0, 1], where in its face each point lies.

    Returns:
        (n, 3) float32, and (n,) the face of each.
    """
    a, b, c = (vertices[faces[:, corner]].astype(np.float64) for corner in range(3))
    edges = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    face = np.minimum(np.searchsorted(edges, shares * edges[-1], side="right"), len(faces) - 1)
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u)[:, None], np.where(over, 1.0 - v, v)[:, None]
    return (a[face] + u * (b - a)[face] + v * (c - a)[face]).astype(np.float32), face
