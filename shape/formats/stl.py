"""STL files, binary and ASCII. Normals and the attribute bytes (colours) are left aside."""

from __future__ import annotations

import codecs
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from .mesh_file import MeshFile, Piece

HEADER, RECORD = 84, 50
"""Bytes before the triangles of a binary file, the last four of them the count; bytes of a triangle."""
UNKNOWN = 0xFFFFFFFF
"""The count of programs that write a file in one go, as is 0."""
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
TEXT = 4096
"""Bytes at the beginning of a file that tell text from numbers."""
CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1a\x1c-\x1f]")
VERTEX = re.compile(rb"vertex\s+(\S+\s+\S+\s+\S+)")
LONGEST_INDENT = 200
MOST_SOLIDS = 1000
"""A file of more solids is one piece: some programs write each triangle as a solid."""


def read(path: Path) -> MeshFile:
    """The solids of an STL file; of a binary one all its triangles as one piece.

    A binary file is told by its length, for its header may begin with `solid`, too. Where its count is 0, unknown or
    less than it holds, the length decides.

    Raises:
        InputError: if it ends in the middle, or has what is no number where coordinates should be.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(TEXT)
        count = int.from_bytes(head[HEADER - 4 : HEADER], "little") if size >= HEADER else 0
        if size != HEADER + RECORD * count or size < HEADER:
            file.seek(0)
            if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
                text = file.read().decode("utf-16", "replace").encode()
                return _file(_solids(text, path))
            if not CONTROL.search(head):
                return _file(_solids(file.read().removeprefix(codecs.BOM_UTF8), path))
        return _read_binary(file, path, size, count)


def _file(pieces: Iterator[Piece], *notes: str) -> MeshFile:
    return MeshFile(tuple(pieces), "resfit", notes=notes)


def _read_binary(file: BinaryIO, path: Path, size: int, count: int) -> MeshFile:
    """The triangles of a binary file, as many as its count and its length say together."""
    if size < HEADER:
        raise InputError(
            f"'{path}' is too short for an STL file ({size} bytes); export or download it again."
        )
    held, rest = divmod(size - HEADER, RECORD)
    notes = []
    if count in (0, UNKNOWN) or (count < held and rest == 0):
        if count != held:
            notes.append(f"Its header says {_triangles(count)}, its length {held}: all {held} were read.")
        if rest:
            notes.append(_behind(rest))
    elif count > held:
        raise InputError(
            f"'{path}' ends in the middle: it says {_triangles(count)} but holds {held}; export or download it again."
        )
    elif size > HEADER + RECORD * count:
        notes.append(_behind(size - HEADER - RECORD * count))
        held = count
    file.seek(HEADER)
    corners = np.fromfile(file, TRIANGLE, held)["corners"]
    return _file(iter([_piece("mesh", corners.astype(np.float64))]), *notes)


def _triangles(count: int) -> str:
    return f"{count} triangle{'' if count == 1 else 's'}"


def _behind(count: int) -> str:
    return f"{count} byte{' was' if count == 1 else 's were'} left out behind its last triangle."


def _piece(name: str, corners: npt.NDArray[Any]) -> Piece:
    """Three vertices of its own for each triangle, as the file has them."""
    return Piece(name, corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3))


def _solids(text: bytes, path: Path) -> Iterator[Piece]:
    """The solids of an ASCII file, named; those without faces are passed over."""
    if b"\r" in text:
        text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    lower = text.lower()
    found = _names(text, lower)
    if len(found) > MOST_SOLIDS:
        merged = [_corners(lower[start:end], path) for _, start, end in found]
        yield _piece("mesh", np.concatenate(merged))
        return
    found = [(name, start, end) for name, start, end in found if lower.find(b"vertex", start, end) >= 0]
    for number, (name, start, end) in enumerate(found, 1):
        unnamed = "mesh" if len(found) == 1 else f"solid {number}"
        yield _piece(name or unnamed, _corners(lower[start:end], path))


def _names(text: bytes, lower: bytes) -> list[tuple[str, int, int]]:
    """(name, begin, end) of what lies between the lines that begin with `solid` or `endsolid`."""
    found, name, start, at = [], "", 0, 0
    while (at := lower.find(b"solid", at)) >= 0:
        line = lower.rfind(b"\n", 0, at) + 1
        before = lower[line:at].strip() if at - line < LONGEST_INDENT else b"?"
        if before not in (b"", b"end"):
            at += 5
            continue
        found.append((name, start, line))
        stop = lower.find(b"\n", at)
        stop = len(text) if stop < 0 else stop
        # A whole file on one line has its first facet behind the name.
        facet = re.search(rb"\sfacet\s+normal\s", lower[at:stop])
        start = at = at + facet.start() if facet else stop
        begin = line + len(lower[line:at]) - len(lower[line:at].lstrip()) + len(before) + 5
        name = "" if before else text[begin:start].decode("utf-8", "replace").strip()
    return [*found, (name, start, len(text))]


def _corners(text: bytes, path: Path) -> npt.NDArray[np.float64]:
    """(m, 3, 3) corners of the facets in a text of lower case."""
    found = VERTEX.findall(text)
    facets = text.count(b"facet") - text.count(b"endfacet")
    if len(found) != text.count(b"vertex") or len(found) < 3 * facets or text.count(b"endfacet") < facets:
        raise InputError(f"'{path}' ends in the middle of a facet; export or download it again.")
    if len(found) > 3 * facets:
        raise InputError(f"'{path}' has facets of more than three corners; export it again as triangles.")
    joined = b" ".join(found)
    try:
        with warnings.catch_warnings():
            # Before NumPy 2.4 it only warns of the first word that is no number, and stops there.
            warnings.simplefilter("error", DeprecationWarning)
            numbers = np.fromstring(joined, np.float64, sep=" ")
    except (ValueError, DeprecationWarning) as error:
        raise _not_a_number(joined, path) from error
    return numbers.reshape(-1, 3, 3)


def _not_a_number(text: bytes, path: Path) -> InputError:
    """Error about the first word of a text that is no number."""
    for word in text.split():
        try:
            float(word)
        except ValueError:
            written = word[:20].decode("utf-8", "replace")
            if re.fullmatch(rb"[-+\d]*,\d+(e[-+]?\d+)?", word):
                return InputError(
                    f"'{path}' writes numbers with commas ('{written}'); export it with decimal points."
                )
            return InputError(f"'{path}' has '{written}' in place of a coordinate; export it again.")
    return InputError(f"'{path}' has coordinates that cannot be read; export it again.")
