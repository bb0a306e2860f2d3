"""Documents of `resfit view`: assemblies by file or by a fit's folder, and the meshes they were fitted to."""

from __future__ import annotations

import stat
from dataclasses import dataclass
from pathlib import Path

from resfit.errors import InputError

from ...assembly.assembly import Assembly
from ...assembly.plain_json import text_at
from ...assembly.provenance import sha256_of_file
from ...assembly.report import read_report

MAX_MESH_BYTES = 2 * 1024 * 1024 * 1024
"""Of a mesh that only a report names: larger ones, such as what stands for all memory, must be given."""


@dataclass(frozen=True)
class Document:
    """An assembly that was opened."""

    assembly: Assembly
    path: Path
    """Of its assembly.json."""
    title: str
    mesh: Path | None = None
    """The mesh that it stands for, where one is known and there."""


def open_documents(paths: list[Path], target: Path | None = None) -> list[Document]:
    """Read assemblies.

    Args:
        paths: assembly.json files, or folders that hold one.
        target: the mesh of all that do not know their own; else it is looked for by the fit's report.

    Raises:
        InputError: if one cannot be read, or there is no such mesh: one sentence.
    """
    if not paths:
        raise InputError("there is nothing to view; give an assembly.json or the folder of a fit.")
    if target is not None and not target.is_file():
        raise InputError(f"there is no mesh '{target}'; check --target.")
    return [_open(path, target) for path in paths]


def _open(path: Path, target: Path | None) -> Document:
    file = path / "assembly.json" if path.is_dir() else path
    if path.is_dir() and not file.is_file():
        raise InputError(
            f"the folder '{path}' holds no assembly.json; give the folder of a fit, or the file."
        )
    assembly = Assembly.load(file)
    folder = file.absolute().parent
    title = folder.name.removesuffix(".resfit") if file.stem == "assembly" else file.stem
    return Document(assembly, file, title, target or reported_mesh(file))


def reported_mesh(file: Path) -> Path | None:
    """The mesh that the report beside an assembly.json names, if it lies near and is still the same; else None."""
    report = read_report(file.parent)
    name = text_at(report, "input", "path") or text_at(report, "input", "name")
    digest = text_at(report, "input", "sha256")
    if not name or not digest:
        return None
    folder = file.absolute().parent
    for base in (Path.cwd(), folder.parent, folder):
        # An absolute name stands for itself, whatever is before it.
        mesh = base / name
        try:
            found = mesh.stat()
            # What the system makes up as it is read says that it has no bytes, and may not end.
            is_file = stat.S_ISREG(found.st_mode) and 0 < found.st_size <= MAX_MESH_BYTES
            if is_file and sha256_of_file(mesh) == digest:
                return mesh
        except (OSError, ValueError, InputError):
            continue
    return None
