"""Mesh files: one module per format, each with `read(path) -> MeshFile`."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from resfit.errors import InputError

if TYPE_CHECKING:
    from .mesh_file import MeshFile

READERS = {
    "glb": "gltf",
    "gltf": "gltf",
    "obj": "by_trimesh",
    "ply": "by_trimesh",
    "stl": "by_trimesh",
    "off": "by_trimesh",
    "3mf": "by_trimesh",
}
"""Suffix in lower case: the module here that reads it. trimesh reads what else it can."""


def read_mesh_file(path: Path) -> MeshFile:
    """The content of a mesh file, read by the module for its suffix.

    Raises:
        InputError: if the format is not known, or the file is damaged or uses what its reader does not support.
    """
    suffix = path.suffix.lower().lstrip(".")
    module = import_module(f".{READERS.get(suffix, 'by_trimesh')}", __name__)
    try:
        return module.read(path)
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror or error}.") from error
