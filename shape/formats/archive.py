"""Archives and packed files (ZIP, tar, gzip, bzip2) that hold one mesh, with the files it needs beside it."""

from __future__ import annotations

import shutil
import stat
import tarfile
import tempfile
import time
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path, PurePosixPath

from resfit.errors import InputError

from . import PACKED, READERS, read_mesh_file, suffix_of
from .mesh_file import MeshFile
from .unpacking import (
    MOST_MEMBERS,
    Metered,
    Stream,
    allowance,
    check_members,
    open_packed,
    refusing_damage,
    too_many,
)  # fmt: skip

PREFIX = "resfit-archive-"
"""How the names of temporary folders begin."""
STALE_SECONDS = 3600.0
PICTURES = (
    "png", "jpg", "jpeg", "tga", "tif", "tiff", "bmp", "gif", "webp", "exr", "hdr", "dds", "ktx", "ktx2", "psd", "svg",
    "pdf", "mp4", "blend",
)  # fmt: skip
"""Suffixes of what often lies beside meshes and is large: it stays packed."""


def read(path: Path) -> MeshFile:
    """The mesh in an archive, read by the reader of its format. Archives within archives stay packed.

    Raises:
        InputError: if it holds no mesh or several, is encrypted or damaged, or unpacks to more than it may.
    """
    with _temporary_folder() as folder:
        members = [name for name in _unpack(path, folder) if not _is_hidden(name)]
        meshes = [name for name in members if suffix_of(name) in READERS and suffix_of(name) not in PACKED]
        if not meshes and len(members) == 1 and not suffix_of(members[0]):
            # Packed alone, a file may have lost its suffix: its first bytes tell what it is.
            meshes = members
        if not meshes:
            within = next((name for name in members if suffix_of(name) in PACKED), None)
            other = f", only another archive '{within}'" if within else ""
            raise InputError(f"'{path}' holds no mesh file{other}; unpack it and give the mesh in it.")
        if len(meshes) > 1:
            some = ", ".join(str(name) for name in meshes[:3]) + (", ..." if len(meshes) > 3 else "")
            raise InputError(f"'{path}' holds {len(meshes)} meshes ({some}); unpack it and give one of them.")
        try:
            found = read_mesh_file(folder / meshes[0])
        except InputError as error:
            raise InputError(str(error).replace(str(folder), str(path))) from error
        notes = tuple(note.replace(str(folder), str(path)) for note in found.notes)
        return replace(found, notes=(f"'{meshes[0]}' was read from the archive.", *notes))


def _is_hidden(name: PurePosixPath) -> bool:
    return any(part.startswith(".") or part == "__MACOSX" for part in name.parts)


@contextmanager
def _temporary_folder() -> Iterator[Path]:
    """A folder that is removed at the end; with it go those that a killed process has left."""
    for left in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        with suppress(OSError):
            if time.time() - left.lstat().st_mtime > STALE_SECONDS:
                shutil.rmtree(left, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix=PREFIX, ignore_cleanup_errors=True) as folder:
        yield Path(folder)


def _unpack(path: Path, folder: Path) -> list[PurePosixPath]:
    """Unpack an archive into a folder; the names of what is there then, in the order of the archive."""
    if zipfile.is_zipfile(path):
        with refusing_damage(path, "ZIP archive"), zipfile.ZipFile(path) as archive:
            return _unpack_zip(path, archive, folder)
    with path.open("rb") as file, refusing_damage(path, "archive"):
        packed = open_packed(path, file.read(3))
        file.seek(0)
        with packed or file as stream:
            allowed = allowance(path)
            if _is_tar(stream.read(512)):
                stream.seek(0)
                return _unpack_tar(path, Metered(stream, allowed, path), folder)
            stream.seek(0)
            if packed is None:
                raise InputError(f"'{path}' is no archive that can be read; export or download it again.")
            name = PurePosixPath(path.stem)
            _write(folder / name, Metered(stream, allowed, path))
            return [name]


def _is_tar(head: bytes) -> bool:
    """True if a block of 512 bytes is the head of a tar archive, by its checksum."""
    try:
        tarfile.TarInfo.frombuf(head, "utf-8", "surrogateescape")
    except tarfile.HeaderError:
        return False
    return True


def _unpack_zip(path: Path, archive: zipfile.ZipFile, folder: Path) -> list[PurePosixPath]:
    members = []
    for member in archive.infolist():
        kind = stat.S_IFMT(member.external_attr >> 16)
        name = _safe_name(member.filename)
        if name and not member.is_dir() and kind in (0, stat.S_IFREG):
            members.append((name, member))
    check_members(path, [member for _, member in members])
    found = []
    for name, member in members:
        with archive.open(member) as stream:
            found += [name] if _write(folder / name, stream) else []
    return found


def _unpack_tar(path: Path, stream: Metered, folder: Path) -> list[PurePosixPath]:
    found = []
    # As a stream: each byte is counted, and no claimed size is believed.
    with tarfile.open(fileobj=stream, mode="r|") as archive:  # type: ignore[call-overload]
        for number, member in enumerate(archive):
            if number >= MOST_MEMBERS:
                raise too_many(path)
            name = _safe_name(member.name)
            content = (
                archive.extractfile(member) if member.type in (tarfile.REGTYPE, tarfile.AREGTYPE) else None
            )
            if name and content and not member.issparse() and _write(folder / name, content):
                found.append(name)
    return found


def _safe_name(name: str) -> PurePosixPath | None:
    """The name of a member if it lies within the folder and is worth unpacking."""
    found = PurePosixPath(name.replace("\\", "/"))
    outside = found.is_absolute() or ".." in found.parts or ":" in name or "\0" in name
    return None if outside or not found.name or suffix_of(found) in PICTURES else found


def _write(path: Path, stream: Stream) -> bool:
    """Write a file; False if its name cannot be, or is taken."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("xb")
    except OSError:
        return False
    with file:
        while chunk := stream.read(1 << 16):
            file.write(chunk)
    return True
