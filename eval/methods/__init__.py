"""Methods to compare: one file each, all with the same contract.

A module has NAME, DESCRIPTION and `run(mesh_path, out, options) -> Path`, which writes `assembly.json`, or a mesh with
a node a part (`parts.glb`), into the folder `out`, in the input's OWN frame, and returns the file. `METHODS` names
them, some more than once with other options. A module loads when it runs: what one needs another need not have, and
the cost of a process is its method's own.

    python -m resfit.eval.methods NAME MESH OUT [key=value ...]
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Method:
    """A method, or a variant of one; names as a module has them."""

    NAME: str
    DESCRIPTION: str
    """For people, one line."""
    module: str
    """File in this folder that has `run`."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """What makes it this variant; a caller's options come on top."""
    package: str = ""
    """Optional package that it needs; empty if none."""

    def run(self, mesh_path: Path, out: Path, options: Mapping[str, Any] | None = None) -> Path:
        """Run it on a mesh and return the file that it wrote into the folder `out`.

        Raises:
            InputError: if the mesh cannot be used, an option makes no sense, or the package is missing.
        """
        module = importlib.import_module(f".{self.module}", __package__)
        return module.run(Path(mesh_path), Path(out), {**self.options, **(options or {})})


_ALL = (
    Method("ours", "this package's fit, preset balanced", "ours"),
    Method("ours-fast", "the same, preset fast", "ours", {"preset": "fast"}),
    Method("ours-best", "the same, preset best", "ours", {"preset": "best"}),
    Method("ours-2", "the same, preset balanced, 2 rounds at most", "ours", {"rounds": 2}),
    Method("ours-10", "the same, preset balanced, 10 rounds at most", "ours", {"rounds": 10}),
    Method("single-shot", "the same, one decomposition and no residual rounds", "ours", {"rounds": 1}),
    Method("mps", "Marching Primitives, our own code, exact distances at 128^3", "marching_primitives"),
    Method("mps-256", "the same, exact distances at 256^3", "marching_primitives", {"resolution": 256}),
    Method(
        "mps-readme",
        "the same, fed as the original's instructions say: dilated, half a cell off",
        "marching_primitives",
        {"feed": "readme"},
    ),
    Method("coacd", "CoACD, threshold 0.05, preprocessing off", "coacd", package="coacd"),
    Method(
        "coacd-default",
        "CoACD, threshold 0.05, its default preprocessing",
        "coacd",
        {"preprocess": "auto"},
        "coacd",
    ),
    Method("vhacd-16", "V-HACD, at most 16 hulls", "vhacd", {"hulls": 16}, "vhacdx"),
    Method("vhacd-64", "V-HACD, at most 64 hulls", "vhacd", {"hulls": 64}, "vhacdx"),
    Method("file", "a finished result: path=results/{stem}.glb or .json", "file"),
)

METHODS: dict[str, Method] = {method.NAME: method for method in _ALL}
"""Every method by name."""
