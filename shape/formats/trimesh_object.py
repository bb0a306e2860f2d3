"""Meshes and scenes that are trimesh objects already."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from resfit.errors import InputError

from .mesh_file import MeshFile, Piece


def from_object(source: Any, name: str) -> MeshFile:
    """The pieces of a trimesh.Trimesh or trimesh.Scene.

    Args:
        source: the object.
        name: what messages call it.

    Raises:
        InputError: if it is neither.
    """
    import trimesh

    pieces, points, lines = [], 0, 0
    with _quiet():
        for node, geometry, matrix in _nodes(source, name):
            faces = np.asarray(getattr(geometry, "faces", np.zeros((0, 3))))
            if len(faces) == 0:
                points += len(getattr(geometry, "vertices", ())) if not hasattr(geometry, "entities") else 0
                lines += len(getattr(geometry, "entities", ()))
                continue
            vertices = np.asarray(geometry.vertices, np.float64)
            if matrix is not None:
                vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
                if np.linalg.det(matrix[:3, :3]) < 0.0:
                    # A mirroring transform turns the surface inside out, unless its triangles turn with it.
                    faces = faces[:, ::-1]
            pieces.append(Piece(str(node), vertices, faces.astype(np.int64)))
    return MeshFile(tuple(pieces), f"trimesh {trimesh.__version__}", points, lines)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep what trimesh logs and warns about off the terminal: what matters is said in our own words."""
    logger = logging.getLogger("trimesh")
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)


def _nodes(source: Any, name: str) -> Iterator[tuple[str, Any, np.ndarray | None]]:
    """(node name, geometry, transform or None) of a trimesh object."""
    if hasattr(source, "graph") and hasattr(source, "geometry"):
        for node in source.graph.nodes_geometry:
            matrix, geometry = source.graph[node]
            matrix = np.asarray(matrix, np.float64)
            yield node, source.geometry[geometry], None if np.array_equal(matrix, np.eye(4)) else matrix
    elif hasattr(source, "vertices"):
        yield "mesh", source, None
    else:
        raise InputError(
            f"{name} is a {type(source).__name__}; give a path, a trimesh.Trimesh or a trimesh.Scene."
        )
