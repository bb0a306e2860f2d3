"""Methods to compare: one file each, all with the same contract.

A module has NAME, DESCRIPTION and `run(mesh_path, out, options) -> Path`, which writes `assembly.json`, or a mesh with
a node a part (`parts.glb`), into the folder `out`, in the input's OWN frame, and returns the file. `METHODS` names
them, some more than once with other options. A module loads when it runs: what one needs another need not have, and
the cost of a process is its method's own.

    python -m resfit.eval.methods NAME[:key=value,...] MESH OUT [key=value ...]
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from resfit.errors import InputError


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


def find_method(text: str) -> Method:
    """The method that a text names: `ours`, or a variant such as `ours:union=hard,rounds=2`.

    Raises:
        InputError: if there is no such method, or what follows the colon is no list of options.
    """
    name, colon, pairs = text.partition(":")
    if name not in METHODS:
        raise InputError(f"there is no method {name}; there are: {', '.join(METHODS)}.")
    if not colon:
        return METHODS[name]
    options = {**METHODS[name].options, **read_pairs(pairs.split(","))}
    return replace(METHODS[name], NAME=text, options=options)


def read_pairs(pairs: Sequence[str]) -> dict[str, str]:
    """Options of texts `key=value`.

    Raises:
        InputError: if a text is nothing of the kind.
    """
    options = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals or not key.strip():
            raise InputError(f"'{pair}' is no option; write key=value.")
        options[key.strip()] = value.strip()
    return options


def split_methods(text: str) -> list[str]:
    """Methods of a list with commas between them; a comma followed by `key=value` goes on with a variant's options."""
    found: list[str] = []
    for piece in text.split(","):
        if found and ":" in found[-1] and "=" in piece and ":" not in piece.partition("=")[0]:
            found[-1] += f",{piece.strip()}"
        else:
            found.append(piece.strip())
    return [name for name in found if name]
