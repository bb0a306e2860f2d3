"""V-HACD 4: voxelised hierarchical convex decomposition (Mamou), through the package vhacdx."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from resfit.errors import InputError

from .hulls import read_normalised, write_hulls
from .options import optional_package, read_options

NAME = "vhacd"
DESCRIPTION = "V-HACD, its default resolution of 400 000 voxels"


def run(mesh_path: Path, out: Path, options: Mapping[str, Any]) -> Path:
    """Decompose a mesh into convex hulls and write `parts.glb`.

    Args:
        mesh_path: what to decompose.
        out: folder for the result.
        options: `hulls`, their largest number (16); `resolution`, voxels (400 000).

    Raises:
        InputError: if the package or the mesh cannot be read, or an option makes no sense.
    """
    chosen = read_options(options, {"hulls": 16, "resolution": 400_000})
    if not (1 <= chosen["hulls"] <= 4096 and 1000 <= chosen["resolution"] <= 64_000_000):
        raise InputError("hulls must be between 1 and 4096, and resolution between 1000 and 64000000.")
    package = optional_package("vhacdx")
    vertices, faces, transform = read_normalised(mesh_path)
    # Faces as VTK has them, the number of corners before the corners: given (m, 3) it returns nonsense, silently.
    listed = np.column_stack([np.full(len(faces), 3), faces]).astype(np.uint32).reshape(-1)
    hulls = package.compute_vhacd(
        vertices, listed, maxConvexHulls=chosen["hulls"], resolution=chosen["resolution"]
    )
    if not len(hulls):
        raise InputError(f"V-HACD found no part in '{mesh_path}'.")
    # What it returns has plain triangles, three corners each and no count.
    return write_hulls([(v, np.asarray(f).reshape(-1, 3)) for v, f in hulls], transform, out)
