"""A finished result of any tool, passed through so that it is measured like the others.

`path` names the file; `{stem}` in it stands for the input's name without its suffix, so that one template serves many
inputs. It is an assembly.json of ours, a mesh whose nodes are the parts (GLB, OBJ, PLY, STL), in the input's own frame,
or the JSON of PrimitiveAnything (see `primitive_anything`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from resfit.errors import InputError

from ...assembly.assembly import Assembly
from ...assembly.atomic_write import write_bytes
from ...assembly.document import FORMAT
from .options import output_folder, read_options
from .primitive_anything import DEFAULTS, read_primitives

NAME = "file"
DESCRIPTION = "a finished result: path=results/{stem}.glb, or .json of ours or of PrimitiveAnything"

MESHES = (".glb", ".obj", ".ply", ".stl")


def run(mesh_path: Path, out: Path, options: Mapping[str, Any]) -> Path:
    """Copy or convert a result into the folder `out`.

    Args:
        mesh_path: the input that the result is of.
        out: folder for the copy.
        options: `path`; those of `primitive_anything.read_primitives`.

    Raises:
        InputError: if there is no such file, or it is of no known kind.
    """
    chosen = read_options(options, {"path": "", **DEFAULTS})
    template = chosen.pop("path")
    if not template:
        raise InputError("the method file needs the option path, for instance path=results/{stem}.glb.")
    source = Path(template.replace("{stem}", mesh_path.stem))
    suffix = source.suffix.lower()
    if suffix not in (*MESHES, ".json"):
        raise InputError(f"'{source}' is neither a mesh ({', '.join(MESHES)}) nor a .json.")
    try:
        content = source.read_bytes()
    except OSError as error:
        raise InputError(f"'{source}' cannot be read: {error.strerror or error}.") from error
    if suffix != ".json":
        path = output_folder(out) / f"parts{suffix}"
        write_bytes(path, content)
        return path
    try:
        document = json.loads(content)
    except ValueError as error:
        raise InputError(f"'{source}' is not JSON: {error}.") from error
    if isinstance(document, dict) and document.get("format") == FORMAT:
        assembly = Assembly.load(source)
    else:
        assembly = read_primitives(document, mesh_path, chosen)
    path = output_folder(out) / "assembly.json"
    assembly.save(path)
    return path
