"""Marching Primitives: superquadrics marched out of a truncated signed distance grid, by our own code.

Written from the idea of Liu, Wu, Ruan and Chirikjian, "Marching-Primitives: Shape Abstraction from Signed Distance
Function" (CVPR 2023); no code of theirs is used. Where this differs, it is so that the method does well:

- The residual is a difference of occupancies (logistic functions of the distances) and not of truncated distances. It
  is as flat away from the surface, and the package's batched normal equations then serve here too.
- All starts of all regions of a level advance in the same launches: boxes and principal axes in three turns, as the
  method has them, and a few balls for regions that bend away from their own middle.

What it shares with the original: superquadrics cannot follow what is thinner than two or three cells, later ones may
freely cross earlier ones, and nothing is ever taken back.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from resfit.errors import InputError

from .options import output_folder, read_options

NAME = "mps"
DESCRIPTION = "Marching Primitives (CVPR 2023), our own code: superquadrics, fed exact signed distances"

FEEDS = ("exact", "readme")

README_LEVEL = 2.0
"""Distance of the surface that the tool's instructions take, times the resolution: [-1, 1] is 2 wide, so one cell."""


def run(mesh_path: Path, out: Path, options: Mapping[str, Any]) -> Path:
    """Fit superquadrics to a mesh and write `assembly.json`, in the mesh's frame by its transform.

    Args:
        mesh_path: what to fit.
        out: folder for the result.
        options: `resolution` of the grid (128); `feed`, exact or readme (see `readme_grid`); `seed`; `device`.

    Raises:
        InputError: if the mesh cannot be read, or an option makes no sense.
    """
    chosen = read_options(options, {"resolution": 128, "feed": "exact", "seed": 0, "device": "auto"})
    if chosen["feed"] not in FEEDS or not 16 <= chosen["resolution"] <= 512:
        raise InputError("feed must be exact or readme, and resolution between 16 and 512.")
    # Warp takes a second to load: options are checked before.
    from ...assembly.assembly import Assembly
    from ...assembly.colors import palette_color
    from ...assembly.provenance import Provenance
    from ...assembly.transform import Transform
    from ...kernels.runtime.launch import choose_device
    from ...shape.grid import distance_grid
    from ...shape.load import load_mesh
    from ...shape.solid import decide_solid
    from .marching_fit import FAMILY
    from .marching_levels import march

    device = choose_device(chosen["device"])
    mesh = load_mesh(mesh_path)
    transform = Transform.from_bounds(mesh.vertices.min(axis=0), mesh.vertices.max(axis=0))
    query = decide_solid(transform.to_normalised(mesh.vertices), mesh.faces, transform.scale, device)
    if chosen["feed"] == "exact":
        grid = distance_grid(query, chosen["resolution"])
    else:
        grid = readme_grid(distance_grid(query, 2 * chosen["resolution"]))
    rows = march(grid, device, seed=chosen["seed"])
    recorded = {"method": NAME, "resolution": chosen["resolution"], "feed": chosen["feed"]}
    provenance = Provenance.current(seed=chosen["seed"], options=recorded, input_sha256=mesh.sha256)
    colors = [palette_color(index) for index in range(len(rows))]
    path = output_folder(out) / "assembly.json"
    Assembly.from_rows(rows, [FAMILY] * len(rows), colors, transform, provenance).save(path)
    return path


def readme_grid(fine: np.ndarray) -> np.ndarray:
    """The grid that one gets by following the original tool's instructions to the letter.

    They take the surface a little outside the mesh, which thickens everything by a cell, and sample from the corner of
    the cube on, where the fit takes the values to be at the centres of cells: half a cell off.

    Args:
        fine: (2 n, 2 n, 2 n) signed distance at the cell centres of [-1, 1]^3, normalised, negative inside.

    Returns:
        (n, n, n) float32: at [i, j, k] the distance at (2 [i, j, k]) / n - 1, less one cell of n.
    """
    level = np.float32(README_LEVEL / (len(fine) // 2))
    padded = np.pad(fine, ((1, 0),) * 3, mode="edge")[:-1, :-1, :-1]
    # A corner of the coarse cells has eight fine centres around it.
    pairs = padded
    for axis in range(3):
        even, odd = (np.take(pairs, range(start, pairs.shape[axis], 2), axis) for start in (0, 1))
        pairs = 0.5 * (even + odd)
    return np.ascontiguousarray(pairs - level, np.float32)
