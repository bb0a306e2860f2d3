"""CoACD: approximate convex decomposition by collision-aware concavity and tree search (Wei et al., SIGGRAPH 2022)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from resfit.errors import InputError

from .hulls import read_normalised, write_hulls
from .options import optional_package, read_options

NAME = "coacd"
DESCRIPTION = "CoACD, threshold 0.05, the mesh as it is (preprocessing off)"

PREPROCESS = ("off", "auto", "on")


def run(mesh_path: Path, out: Path, options: Mapping[str, Any]) -> Path:
    """Decompose a mesh into convex hulls and write `parts.glb`.

    Args:
        mesh_path: what to decompose.
        out: folder for the result.
        options: `threshold` of concavity (0.05); `preprocess`: off, auto or on, which remeshes what CoACD finds not to
            be manifold at `preprocess_resolution` (50) and loses what is thin; `max_hulls` (-1, no limit); `seed`.

    Raises:
        InputError: if the package or the mesh cannot be read, or an option makes no sense.
    """
    chosen = read_options(
        options,
        {"threshold": 0.05, "preprocess": "off", "preprocess_resolution": 50, "max_hulls": -1, "seed": 0},
    )
    if chosen["preprocess"] not in PREPROCESS or not 0.0 < chosen["threshold"] <= 1.0:
        raise InputError("preprocess must be off, auto or on, and threshold above 0 and at most 1.")
    package = optional_package("coacd")
    # It writes hundreds of lines to stdout otherwise.
    package.set_log_level("off")
    vertices, faces, transform = read_normalised(mesh_path)
    hulls = package.run_coacd(
        package.Mesh(vertices, faces.astype(np.int32)),
        threshold=chosen["threshold"],
        max_convex_hull=chosen["max_hulls"],
        preprocess_mode=chosen["preprocess"],
        preprocess_resolution=chosen["preprocess_resolution"],
        seed=chosen["seed"],
    )
    if not len(hulls):
        raise InputError(f"CoACD found no part in '{mesh_path}'.")
    return write_hulls([(np.asarray(v), np.asarray(f)) for v, f in hulls], transform, out)
