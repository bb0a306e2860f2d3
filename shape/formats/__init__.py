"""Mesh files: one module per format, each with `read(path) -> MeshFile`."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from resfit.errors import InputError

if TYPE_CHECKING:
    from .mesh_file import MeshFile

READERS = {
    "glb": "gltf",
    "gltf": "gltf",
    "obj": "obj",
    "ply": "ply",
    "stl": "stl",
    "off": "off",
    "3mf": "threemf",
    "zip": "archive",
    "tar": "archive",
    "gz": "archive",
    "tgz": "archive",
    "bz2": "archive",
    "tbz2": "archive",
}
"""Suffix in lower case: the module here that reads it. No other format is read."""

PACKED = frozenset(suffix for suffix, module in READERS.items() if module == "archive")
"""Suffixes of archives and packed files."""

MESH_SUFFIXES = tuple(f".{suffix}" for suffix in READERS if suffix not in PACKED)
"""Suffixes of mesh files, with their dots."""


def suffix_of(path: PurePath) -> str:
    """The suffix of a path in lower case, without its dot."""
    return path.suffix.lower().lstrip(".")


def read_mesh_file(path: Path) -> MeshFile:
    """The content of a mesh file, read by the module for its suffix, or for its first bytes where they tell another.

    Raises:
        InputError: if the format is not read, or the file is damaged or uses what its reader does not support.
    """
    try:
        suffix = suffix_of(path)
        kind = _choose(path, suffix)
        found = import_module(f".{READERS[kind]}", __name__).read(path)
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror or error}.") from error
    if READERS[kind] == READERS.get(suffix) or not suffix:
        return found
    return replace(
        found, notes=(f"Its name ends in .{suffix}, but its content is {kind.upper()}.", *found.notes)
    )


def _choose(path: Path, suffix: str) -> str:
    """The suffix by which a file is to be read.

    Raises:
        InputError: if no format that is read fits it.
    """
    from .foreign import FOREIGN, refusal
    from .signature import CONTAINERS, kind_of

    kind = kind_of(path)
    if kind is None or (kind in CONTAINERS and (suffix in FOREIGN or suffix == "3mf")):
        # Many formats are ZIP or gzip within: 3MF, USDZ, FCStd, older .blend.
        kind = suffix
    if kind in READERS:
        return kind
    if kind in FOREIGN:
        raise refusal(path, kind)
    written = f"'.{suffix}'" if suffix else "no suffix"
    raise InputError(
        f"'{path}' has {written}, which is no mesh format known here; convert it to GLB, OBJ, PLY or STL."
    )
