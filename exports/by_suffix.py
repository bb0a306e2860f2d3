"""The registry of exporters: one file a format, found by scanning this folder for modules that define `EXPORTER`."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from resfit.errors import InputError

from .exporter import Exporter, ExportOptions

if TYPE_CHECKING:
    from ..assembly.assembly import Assembly


@cache
def exporters() -> dict[str, Exporter]:
    """Every exporter by suffix, in alphabetical order; all formats' modules are loaded."""
    package = __name__.rpartition(".")[0]
    names = sorted(module.name for module in pkgutil.iter_modules(importlib.import_module(package).__path__))
    modules = [importlib.import_module(f"{package}.{name}") for name in names]
    found = [module.EXPORTER for module in modules if hasattr(module, "EXPORTER")]
    return {suffix: exporter for exporter in found for suffix in exporter.suffixes}


def check_path(path: str | Path) -> Exporter:
    """The exporter for a path, before any work is done for it.

    Raises:
        InputError: if no format has this suffix, or the folder is not there.
    """
    path = Path(path)
    exporter = exporters().get(path.suffix.lower())
    if exporter is None:
        raise InputError(f"cannot export to {path}: the name must end in one of {', '.join(exporters())}.")
    if not path.parent.is_dir():
        raise InputError(f"cannot write {path}: there is no folder {path.parent}.")
    return exporter


def check_options(paths: Sequence[Path], names: Iterable[str]) -> None:
    """Refuse an option that none of the paths' formats takes.

    Raises:
        InputError: if there is one, by its name.
    """
    taken = {option for path in paths for option in check_path(path).options}
    for name in names:
        if name not in taken:
            takers = [suffix for suffix, exporter in exporters().items() if name in exporter.options]
            use = f"it is for {', '.join(takers)}" if takers else "no format has such an option"
            raise InputError(f"--{name} has no effect on {', '.join(map(str, paths))}; {use}.")


def export_assembly(assembly: Assembly, path: str | Path, **options: Unpack[ExportOptions]) -> None:
    """Write an assembly in the format that the suffix of `path` names, at once or not at all.

    Args:
        assembly: what to write; coordinates in the file are in the input mesh's own frame.
        path: .glb, .obj, .ply or .stl; or .html, a page that draws and edits the assembly itself.
        options: those that the format takes. Of meshes: `merged` (one surface of the smooth union, or one closed
            surface a part), `resolution` (cells along the longest side, of the whole or of each part) and `device`. Of
            pages: `mesh` (the input), `up` (y or z), `title` and `facts` (sentences).

    Raises:
        InputError: if the suffix is unknown, the format does not take an option, or the file cannot be written.
    """
    path = Path(path)
    given = {name: value for name, value in options.items() if value is not None}
    check_options([path], given)
    check_path(path).write(assembly, path, **given)
