"""Mesh files as trimesh reads them, to compare readers with where it is right."""

from __future__ import annotations

from pathlib import Path

import trimesh

from resfit.shape.formats.mesh_file import MeshFile
from resfit.shape.formats.trimesh_object import from_object


def read_by_trimesh(path: Path) -> MeshFile:
    """What trimesh finds in a file."""
    return from_object(trimesh.load_scene(path, process=False), str(path))
