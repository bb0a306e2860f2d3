"""Which file writes which format, by the suffix of the path."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from resfit.errors import InputError

if TYPE_CHECKING:
    from ..assembly.assembly import Assembly

Writer = Callable[..., None]


def _write_mesh(assembly: Assembly, path: Path, **options: object) -> None:
    from .mesh import write_mesh

    write_mesh(assembly, path, **options)  # type: ignore[arg-type]


def _write_page(assembly: Assembly, path: Path, **_: object) -> None:
    from .html import write_html

    write_html(assembly, path)


WRITERS: dict[str, Writer] = {
    ".glb": _write_mesh,
    ".obj": _write_mesh,
    ".ply": _write_mesh,
    ".stl": _write_mesh,
}
"""Suffix to writer of a mesh; each loads its format's module when it is used."""

PAGES: dict[str, Writer] = {".html": _write_page}
"""The same for what holds the field itself, which knows no resolution."""


def check_path(path: str | Path) -> Writer:
    """The writer for a path, before any work is done for it.

    Raises:
        InputError: if no format has this suffix, or the folder is not there.
    """
    path = Path(path)
    known = WRITERS | PAGES
    writer = known.get(path.suffix.lower())
    if writer is None:
        raise InputError(f"cannot export to {path}: the name must end in one of {', '.join(known)}")
    if not path.parent.is_dir():
        raise InputError(f"cannot write {path}: there is no folder {path.parent}")
    return writer


def export_assembly(
    assembly: Assembly,
    path: str | Path,
    *,
    merged: bool | None = None,
    resolution: int | None = None,
    device: str = "auto",
) -> None:
    """Write an assembly in the format that the suffix of `path` names, at once or not at all.

    Args:
        assembly: what to write; coordinates in the file are in the input mesh's own frame.
        path: .glb, .obj, .ply or .stl; or .html, a page that draws and edits the assembly itself.
        merged: one surface of the smooth union, or one closed surface a part; None is what suits the format.
        resolution: cells along the longest side, of the whole or of each part; None is what suits.
        device: `auto` (the CPU), `cpu`, `cuda:0`.

    Raises:
        InputError: if the suffix is unknown or the file cannot be written.
    """
    check_path(path)(assembly, Path(path), merged=merged, resolution=resolution, device=device)
