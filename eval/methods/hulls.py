"""Convex hulls as a file of named parts, and the mesh that they are made from."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...assembly.atomic_write import replacing
from ...assembly.transform import Transform
from ...shape.load import load_mesh
from .options import output_folder

Part = tuple[np.ndarray, np.ndarray]
"""Vertices (v, 3) and triangles (f, 3)."""


def read_normalised(mesh_path: Path) -> tuple[np.ndarray, np.ndarray, Transform]:
    """A welded mesh in the normalised frame: vertices (n, 3) float64, faces (m, 3), the way back to its own frame.

    The tools compare sizes with constants of their own, and some compute in float32: a mesh of 1e-7 or a million units
    would be another mesh to them.
    """
    mesh = load_mesh(mesh_path)
    transform = Transform.from_bounds(mesh.vertices.min(axis=0), mesh.vertices.max(axis=0))
    return transform.to_normalised(mesh.vertices), mesh.faces, transform


def write_hulls(hulls: Sequence[Part], transform: Transform, out: Path) -> Path:
    """Write `parts.glb`: nodes hull_00, hull_01, ..., in the mesh's own frame.

    Args:
        hulls: in the normalised frame.
        transform: to the mesh's frame.
        out: folder for the result.
    """
    import trimesh

    scene = trimesh.Scene()
    # A file holds vertices in float32: they stay normalised, and each node has the way to the mesh's frame.
    matrix = np.diag([transform.scale] * 3 + [1.0])
    matrix[:3, 3] = transform.translation
    for number, (vertices, faces) in enumerate(hulls):
        name = f"hull_{number:02d}"
        part = trimesh.Trimesh(vertices, faces, process=False)
        scene.add_geometry(part, node_name=name, geom_name=name, transform=matrix)
    path = output_folder(out) / "parts.glb"
    with replacing(path) as temporary:
        scene.export(temporary, file_type="glb")
    return path
