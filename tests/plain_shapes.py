"""Meshes of the plainest solids, with vertices on the exact surface: what a fit should give back as one part."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation
from trimesh import creation

SEGMENTS = 128
"""Of every circle: a facet's middle is off the exact surface by 0.03 % of the radius."""

TURN = Rotation.from_rotvec([0.5, -0.8, 0.3]).as_matrix()


def frustum(bottom: float, top: float, height: float) -> trimesh.Trimesh:
    """A cone or its frustum along z."""
    angle = np.linspace(0.0, 2.0 * np.pi, SEGMENTS, endpoint=False)
    ring = np.c_[np.cos(angle), np.sin(angle)]
    ends = [np.c_[radius * ring, np.full(SEGMENTS, z)] for radius, z in ((bottom, 0.0), (top, height))]
    points = np.concatenate([*ends, [(0.0, 0.0, 0.0), (0.0, 0.0, height)]])
    return trimesh.convex.convex_hull(points)


def elbow(bend: float, radius: float, angle: float) -> trimesh.Trimesh:
    """A pipe bent about z, from the x axis on."""
    along = np.linspace(0.0, angle, SEGMENTS)[:, None]
    round_it = np.linspace(0.0, 2.0 * np.pi, SEGMENTS, endpoint=False)[None]
    out = bend + radius * np.cos(round_it)
    up = np.broadcast_to(radius * np.sin(round_it), (SEGMENTS, SEGMENTS))
    tube = np.stack([out * np.cos(along), out * np.sin(along), up], axis=-1).reshape(-1, 3)
    middles = bend * np.array([(1.0, 0.0, 0.0), (np.cos(angle), np.sin(angle), 0.0)])
    here = np.arange(SEGMENTS)
    after = (here + 1) % SEGMENTS
    rows = (np.arange(SEGMENTS - 1) * SEGMENTS)[:, None]
    a, b = (rows + here).ravel(), (rows + after).ravel()
    wall = np.concatenate([np.c_[a, a + SEGMENTS, b + SEGMENTS], np.c_[a, b + SEGMENTS, b]])
    last = SEGMENTS * (SEGMENTS - 1)
    caps = [
        np.c_[here, after, np.full(SEGMENTS, len(tube))],
        np.c_[last + after, last + here, np.full(SEGMENTS, len(tube) + 1)],
    ]
    mesh = trimesh.Trimesh(np.concatenate([tube, middles]), np.concatenate([wall, *caps]))
    mesh.fix_normals()
    return mesh


def rounded_box(extents: tuple[float, float, float], radius: float) -> trimesh.Trimesh:
    """A box with rounded edges: the hull of a ball at each corner."""
    ball = creation.icosphere(subdivisions=5, radius=radius).vertices
    signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
    return trimesh.convex.convex_hull(
        np.concatenate([ball + sign * (np.array(extents) / 2 - radius) for sign in signs])
    )


def capsule(length: float, radius: float) -> trimesh.Trimesh:
    """A capsule along z; `length` between the centres of its ends."""
    return creation.capsule(height=length, radius=radius, count=[SEGMENTS, SEGMENTS])


def ring(radius: float, thickness: float) -> trimesh.Trimesh:
    """A torus about z by its radius and that of its tube."""
    return creation.torus(radius, thickness, major_sections=SEGMENTS, minor_sections=SEGMENTS)


SHAPES: dict[str, Callable[[], trimesh.Trimesh]] = {
    "box": lambda: creation.box((1.0, 2.0, 3.0)),
    "cube": lambda: creation.box((2.0, 2.0, 2.0)),
    "cylinder": lambda: creation.cylinder(1.0, 3.0, sections=SEGMENTS),
    "disc": lambda: creation.cylinder(2.0, 0.4, sections=SEGMENTS),
    "cone": lambda: frustum(1.0, 0.0, 2.5),
    "frustum": lambda: frustum(1.2, 0.5, 2.0),
    "pyramid": lambda: trimesh.convex.convex_hull(
        [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 1.8)]
    ),
    "sphere": lambda: creation.icosphere(subdivisions=5),
    "fat capsule": lambda: capsule(1.0, 1.0),
    "thin capsule": lambda: capsule(6.0, 0.3),
    "torus": lambda: ring(2.0, 0.4),
    "thick torus": lambda: ring(2.0, 1.2),
    "tube": lambda: creation.annulus(0.7, 1.0, 2.5, sections=SEGMENTS),
    "pipe elbow": lambda: elbow(2.0, 0.5, 0.5 * np.pi),
    "rounded box": lambda: rounded_box((2.0, 3.0, 1.4), 0.3),
    "thin plate": lambda: creation.box((4.0, 3.0, 0.06)),
    "thin rod": lambda: creation.cylinder(0.04, 4.0, sections=SEGMENTS),
}
"""Name: a mesh, upright."""

BENT = ("pipe elbow",)
TAPERED = ("cone", "frustum", "pyramid")


def plain_shape(name: str, turned: bool = False) -> trimesh.Trimesh:
    """A mesh of SHAPES, upright or turned about no axis in particular."""
    mesh = SHAPES[name]()
    if turned:
        motion = np.eye(4)
        motion[:3, :3] = TURN
        mesh.apply_transform(motion)
    return mesh


def longest_side(name: str) -> float:
    """Of the upright shape's box."""
    return float(SHAPES[name]().extents.max())
