"""`resfit export`: an assembly in other formats."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from resfit.errors import InputError


def export(
    assembly: Path,
    /,
    *outputs: Path,
    merged: Annotated[bool | None, Parameter(negative="--parts")] = None,
    top: int | None = None,
    resolution: int | None = None,
    device: str = "auto",
) -> int:
    """Write an assembly in other formats, chosen by suffix: .glb .obj .ply .stl.

    Args:
        assembly: the assembly.json to read.
        outputs: the files to write.
        merged: one surface of the smooth union (PLY and STL unless told otherwise), or one object a part.
        top: only so many parts, the most worthwhile: by the gains in the report.json beside the assembly, or else by
            the volume that each alone holds.
        resolution: cells along the longest side, of the whole or of each part.
        device: auto, cpu or cuda:0.
    """
    if not outputs:
        raise InputError("resfit export needs at least one file to write, such as chair.glb.")
    from resfit.assembly.assembly import Assembly
    from resfit.export.by_suffix import check_path, export_assembly

    for path in outputs:
        check_path(path)
    if top is not None and top < 1:
        raise InputError(f"--top {top} is out of range; it must be at least 1.")
    loaded = Assembly.load(assembly)
    if top is not None and top < len(loaded.primitives):
        from resfit.assembly.worth import part_worths

        loaded = loaded.top(top, part_worths(loaded, assembly, device))
    for path in outputs:
        export_assembly(loaded, path, merged=merged, resolution=resolution, device=device)
    return 0
