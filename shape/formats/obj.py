"""Wavefront OBJ: polygons, and their objects or groups. Materials, texture coordinates and normals are passed over."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from resfit.errors import InputError

from .indexed import cut_polygons
from .mesh_file import MeshFile, Piece
from .text import BLANK, TextLines, decode_name, plain_text

NAMELESS = "mesh"
"""The piece of faces that belong to no object and no group."""

STATEMENT = rb"[vflp][ \t\v]"
"""Begin of a line of numbers that are read."""

FREEFORM = {b"curv", b"surf", b"bzp", b"bsp", b"cdc", b"cdp"}
"""Keywords of freeform curves and surfaces, old ones too."""


def read(path: Path) -> MeshFile:
    """The polygons of an OBJ file; its objects are the pieces, or its groups where it has not two objects with faces.

    Negative indices count back from the vertices above their own line. Nothing else is opened: no material library,
    no file that `call` names.

    Raises:
        InputError: if a line is damaged, which it names, or there are freeform surfaces and no polygons.
    """
    lines = TextLines(_clean(plain_text(path.read_bytes())), f"'{path}'")
    kinds, short = lines.raw[lines.starts], BLANK[lines.second]
    found = {letter: np.flatnonzero((kinds == ord(letter)) & short) for letter in "vflpog"}
    numbers = lines.numbers(found["v"], keyword=1)
    _check_counts(lines, found["v"], numbers.counts, 3)
    vertices = np.ascontiguousarray(numbers.columns(3))
    corners = lines.numbers(found["f"], np.int64, keyword=1, slashes=True)
    indices = _from_zero(lines, corners.values, np.repeat(found["f"], corners.counts), found["v"])
    cut = cut_polygons(vertices, indices, corners.counts, lambda face: lines.name(found["f"][face]))
    segments = lines.numbers(found["l"], np.int64, keyword=1, slashes=True).counts
    marks = lines.numbers(found["p"], np.int64, keyword=1, slashes=True).counts
    left_out = cut.lines + int(np.maximum(segments - 1, 0).sum())
    points = cut.points + int(marks.sum())
    notes = _left_out(lines, len(cut.faces) > 0)
    if not len(cut.faces) and not left_out:
        points = max(points, len(vertices))
    names, label = _labels(lines, found)
    pieces = _pieces(vertices, cut.faces, names, label[cut.owners])
    return MeshFile(tuple(pieces), "resfit", points, left_out, notes)


def _clean(text: bytes) -> bytes:
    r"""The text without indents and comments behind numbers, continued lines joined by `\v`."""
    if text[:1] in b" \t" or b"\n " in text or b"\n\t" in text:
        text = re.sub(rb"^[ \t]+", b"", text, flags=re.MULTILINE)
    if b"\\\n" in text:
        # Of numbers only: a name or a comment may end with a backslash of its own, as paths do.
        continued = re.compile(rb"^" + STATEMENT + rb"(?:[^#\n]*\\\n)+", re.MULTILINE)
        text = continued.sub(lambda match: match[0].replace(b"\\\n", b" \v"), text) + b"\n"
    if text.count(b"#") > text.count(b"\n#"):
        text = re.sub(rb"^(" + STATEMENT + rb"[^#\n]*)#.*", rb"\1", text, flags=re.MULTILINE)
    return text


def _check_counts(lines: TextLines, chosen: np.ndarray, counts: np.ndarray, least: int) -> None:
    short = np.flatnonzero(counts < least)
    if len(short):
        count = counts[short[0]]
        held = f"{count} {'number' if count == 1 else 'numbers'}"
        raise InputError(
            f"{lines.name(int(chosen[short[0]]))} holds {held} where a vertex needs {least}; export the file again."
        )


def _from_zero(
    lines: TextLines, indices: np.ndarray, line: np.ndarray, vertex_lines: np.ndarray
) -> np.ndarray:
    """Indices from 1 on, or back from their own line, as indices from 0 on; negative ones are none.

    Args:
        lines: the file.
        indices: (k,) as the file has them.
        line: (k,) the line of each.
        vertex_lines: (n,) the line of each vertex, ascending.
    """
    if not len(indices) or indices.min() > 0:
        return indices - 1
    if (indices == 0).any():
        raise InputError(
            f"{lines.name(line[np.argmax(indices == 0)])} names vertex 0, but OBJ counts from 1; export the file again."
        )
    back = indices < 0
    indices = np.where(back, indices, indices - 1)
    indices[back] += np.searchsorted(vertex_lines, line[back])
    return indices


def _left_out(lines: TextLines, has_faces: bool) -> tuple[str, ...]:
    """Sentences about freeform geometry and files that are called."""
    likely = np.isin(lines.raw[lines.starts], list(b"bcs")) & np.isin(lines.second, list(b"udzsa"))
    keywords = [lines.line(index).split(None, 1)[0] for index in np.flatnonzero(likely)]
    notes, count = [], sum(keyword in FREEFORM for keyword in keywords)
    if count:
        what = f"{count} freeform {'curve or surface' if count == 1 else 'curves and surfaces'}"
        if not has_faces:
            raise InputError(f"{lines.where} holds {what} but no faces; export it as polygons.")
        notes.append(f"{what} {'was' if count == 1 else 'were'} left out.")
    if b"call" in keywords:
        notes.append("The files that the OBJ file calls were not read.")
    return tuple(notes)


def _labels(lines: TextLines, found: dict[str, np.ndarray]) -> tuple[list[str], np.ndarray]:
    """Names, and the index of its name for each line of a face."""
    best: tuple[list[str], np.ndarray] = [NAMELESS], np.zeros(len(found["f"]), np.int64)
    for letter in "og":
        numbers: dict[str, int] = {NAMELESS: 0}
        of_line = [0]
        for index in found[letter]:
            name = decode_name(lines.line(index)[2:].strip()) or NAMELESS
            of_line.append(numbers.setdefault(name, len(numbers)))
        label = np.array(of_line)[np.searchsorted(found[letter], found["f"])]
        several = len(label) > 0 and (label != label[0]).any()
        if several or (len(label) and label[0] and best[0] == [NAMELESS]):
            best = list(numbers), label
        if several:
            break
    return best


def _pieces(vertices: np.ndarray, faces: np.ndarray, names: list[str], label: np.ndarray) -> list[Piece]:
    """Runs of faces with one name; each has the vertices that it uses, in their order, if there are several."""
    starts = np.flatnonzero(np.diff(label, prepend=-1))
    if len(starts) < 2:
        return [Piece(names[label[0]] if len(label) else NAMELESS, vertices, faces)]
    run = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(faces)))
    used, local = np.unique(run[:, None] * len(vertices) + faces, return_inverse=True)
    bounds = np.searchsorted(used, np.arange(len(starts) + 1) * len(vertices))
    local = local.reshape(-1, 3) - bounds[run][:, None]
    own = vertices[used % len(vertices)]
    ends = np.append(starts[1:], len(faces))
    return [
        Piece(names[label[start]], own[low:high], local[start:end])
        for start, end, low, high in zip(starts, ends, bounds[:-1], bounds[1:], strict=True)
    ]
