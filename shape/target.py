"""From a mesh to everything the fitter needs to know about it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from ..assembly.transform import Transform
from .grid import distance_grid, grid_volume
from .load import load_mesh
from .loaded_mesh import LoadedMesh, Part
from .samples import Samples, make_samples
from .solid import decide_solid
from .solid_query import Solid, SolidQuery

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True, eq=False)
class Target:
    """A shape to be fitted, in the normalised frame: bounding box centred, longest side 1.8. Equal only to itself."""

    transform: Transform
    """Takes normalised points to the mesh's frame."""
    vertices: np.ndarray
    """(n, 3) float32, normalised, welded."""
    faces: np.ndarray
    """(m, 3) int32, as they came."""
    parts: tuple[Part, ...]
    """Nodes of the scene and their faces."""
    solid: Solid
    query: SolidQuery
    """Exact signed distances at further points."""
    grid: np.ndarray
    """(n, n, n) float32, signed distance at the cell centres of [-1, 1]^3, negative inside."""
    resolution: int
    samples: Samples
    lower: np.ndarray
    upper: np.ndarray
    """(3,) float64 each, corners of the solid's bounding box, normalised; sheets have their thickness."""
    sentence: str
    """What the solid was decided to be."""
    notes: tuple[str, ...]
    """What else was changed on the way, in sentences."""
    input_sha256: str
    volume: float
    """Of the solid, in cubed normalised units, by counting cells."""
    reader: str = ""
    """What read the file, with its version."""


def make_target(
    source: str | PathLike[str] | trimesh.Trimesh | trimesh.Scene | LoadedMesh,
    device: wp.Device,
    resolution: int = 128,
    sample_count: int = 20_000,
    seed: int = 0,
    on_stage: Callable[[str], None] | None = None,
) -> Target:
    """Load a mesh, decide what its solid is, and measure it.

    Args:
        source: a path, a trimesh object, or what `load_mesh` made of one.
        device: where to compute.
        resolution: cells along a side of the grid, 2 to 1024.
        sample_count: near points, volume points, and about the number of surface points.
        seed: equal seeds give equal samples.
        on_stage: called with the name of each stage as it begins: load, solid, grid, samples.

    Raises:
        InputError: if the mesh cannot be read, or holds nothing solid.
    """
    begin = on_stage or (lambda name: None)
    begin("load")
    mesh = source if isinstance(source, LoadedMesh) else load_mesh(source)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    transform = Transform.from_bounds(low, high)
    vertices = transform.to_normalised(mesh.vertices)
    begin("solid")
    query = decide_solid(vertices, mesh.faces, transform.scale, device)
    solid = query.solid
    begin("grid")
    grid = distance_grid(query, resolution)
    begin("samples")
    lower, upper = transform.to_normalised(np.stack([low, high]))
    if solid.thickness:
        lower, upper = lower - 0.5 * solid.thickness, upper + 0.5 * solid.thickness
    samples = make_samples(query, lower, upper, sample_count, seed)
    return Target(
        transform, vertices.astype(np.float32), mesh.faces.astype(np.int32), mesh.parts, solid, query, grid,
        resolution, samples, lower, upper, solid.sentence, mesh.notes, mesh.sha256, grid_volume(grid), mesh.reader,
    )  # fmt: skip
