"""Check of a mesh file's path, before anything is loaded that could read the file. Imports nothing heavy."""

from __future__ import annotations

from pathlib import Path

from resfit.errors import InputError


def check_mesh_path(path: Path) -> None:
    """Refuse a path that is not a regular, readable file with something in it.

    Raises:
        InputError: if so: one sentence.
    """
    try:
        if path.is_dir():
            raise InputError(f"'{path}' is a folder, not a mesh file; give the path of one file in it.")
        if not path.exists():
            raise InputError(f"there is no file '{path}'; check the path.")
        if not path.is_file():
            raise InputError(
                f"'{path}' is a pipe or device, not a regular file; write the mesh to a file first."
            )
        if path.stat().st_size == 0:
            raise InputError(f"'{path}' is empty (0 bytes); export or download it again.")
        path.open("rb").close()
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror or error}.") from error
