"""Path arguments of a command line, and what to do where another command was meant. Imports nothing heavy."""

from __future__ import annotations

import shlex
from collections import Counter
from pathlib import Path

from resfit.errors import InputError
from resfit.result.folder import default_folder, holds_fit
from resfit.shape.formats import MESH_SUFFIXES
from resfit.shape.mesh_path import check_mesh_path

ASSEMBLY = "assembly.json"


def check_mesh(path: Path) -> None:
    """Refuse what is not a mesh file that can be read.

    Raises:
        InputError: if so; of a folder it says how to fit or see what is in it.
    """
    if not path.is_dir():
        check_mesh_path(path)
        return
    name = shlex.quote(str(path))
    if holds_fit(path):
        raise InputError(f"'{path}' is the folder of a fit; call resfit view {name} to see it.")
    suffixes = Counter(entry.suffix for entry in path.iterdir() if entry.suffix.lower() in MESH_SUFFIXES)
    if not suffixes:
        raise InputError(f"'{path}' is a folder without a mesh in it; give mesh files.")
    files = " ".join(f"{name}/*{suffix}" for suffix in sorted(suffixes))
    count = suffixes.total()
    raise InputError(
        f"'{path}' is a folder with {count} mesh{'' if count == 1 else 'es'} in it;"
        f" call resfit fit {files}, or resfit gallery {name} -o gallery for a page of all."
    )


def assembly_file(path: Path) -> Path:
    """The file of an assembly that is given by its path, or by the folder of a fit.

    Raises:
        InputError: if there is no assembly in the folder, or the path is that of a mesh.
    """
    if path.is_dir():
        if not (path / ASSEMBLY).is_file():
            raise InputError(
                f"the folder '{path}' holds no {ASSEMBLY}; give the folder of a fit, or the file."
            )
        return path / ASSEMBLY
    if path.suffix.lower() in MESH_SUFFIXES and path.is_file():
        mesh, folder = shlex.quote(str(path)), shlex.quote(str(default_folder(path)))
        raise InputError(
            f"'{path}' is a mesh, not an assembly; call resfit fit {mesh} first, and then give {folder}."
        )
    return path
