"""Object File Format (OFF): polygons by the indices of their corners. Colours and normals are passed over."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from resfit.errors import InputError

from .indexed import check_held, cut_polygons
from .mesh_file import MeshFile, Piece
from .text import Numbers, TextLines, is_whole, plain_text

HEADER = re.compile(rb"\s*(?:ST)?C?N?(4?)(n?)OFF[ \t]*(BINARY)?\s*", re.ASCII)
"""Keyword; the letters before OFF say what vertices have beside x, y, z. Counts may follow without a blank."""


def read(path: Path) -> MeshFile:
    """The polygons of an OFF file in text form. Vertices of 4OFF are divided by their fourth, homogeneous coordinate.

    Raises:
        InputError: if it is no OFF file, or a binary one, or a line is damaged, which it names.
    """
    where = f"'{path}'"
    text = re.sub(rb"#.*", b"", plain_text(path.read_bytes()))
    header = HEADER.match(text)
    if header is None:
        raise InputError(f"{where} is no OFF file: it does not begin with OFF; check what it is.")
    if header[3]:
        raise InputError(
            f"{where} is a binary OFF file, which cannot be read here; save it as text, or as PLY."
        )
    begin = header.end()
    lines = TextLines(text[begin:] or b"\n", where, text.count(b"\n", 0, begin) + 1)
    filled = _filled(lines)
    if header[2]:
        filled = _check_dimension(lines, filled)
    vertex_count, face_count = _counts(lines, filled, where)
    width = 4 if header[1] else 3
    rows = filled[1 : 1 + vertex_count]
    vertices = _vertices(lines, rows, width)
    rows = filled[1 + vertex_count : 1 + vertex_count + face_count]
    corners, counts = _corners(lines, rows, lines.numbers(rows))
    cut = cut_polygons(vertices, corners, counts, lambda face: lines.name(rows[face]))
    points = cut.points if len(cut.faces) or cut.lines else max(cut.points, vertex_count)
    return MeshFile(
        (Piece("mesh", vertices, cut.faces),),
        "resfit",
        points,
        cut.lines,
        _left_over(len(filled) - 1 - vertex_count - face_count),
    )


def _filled(lines: TextLines) -> np.ndarray:
    """Indices of the lines that hold more than blanks."""
    lengths = lines.ends - lines.starts
    # Most lines are long and begin with a digit; only the others are looked at one by one.
    odd = np.flatnonzero((lengths < 3) | ~np.isin(lines.raw[lines.starts], list(b"0123456789-+.")))
    empty = [index for index in odd if not lines.line(index).strip()]
    return np.delete(np.arange(len(lengths)), np.array(empty, np.int64))


def _check_dimension(lines: TextLines, filled: np.ndarray) -> np.ndarray:
    """The lines after that of the dimension, which nOFF has, and which must be three."""
    if not len(filled) or lines.line(filled[0]).strip() != b"3":
        raise InputError(f"{lines.where} holds no shape in three dimensions; export it as a triangle mesh.")
    return filled[1:]


def _counts(lines: TextLines, filled: np.ndarray, where: str) -> tuple[int, int]:
    """Vertices and faces that the file says it holds, and does hold."""
    head = lines.numbers(filled[:1], np.int64)
    if len(head.values) < 2 or head.values.min() < 0:
        raise InputError(
            f"{where} does not say after OFF how many vertices and faces it holds; export it again."
        )
    vertex_count, face_count = (int(value) for value in head.values[:2])
    held = len(filled) - 1
    check_held(where, vertex_count, held, ("vertex", "vertices"))
    check_held(where, face_count, held - vertex_count, ("face", "faces"))
    return vertex_count, face_count


def _vertices(lines: TextLines, rows: np.ndarray, width: int) -> np.ndarray:
    """Vertices (n, 3) of some lines, which begin with `width` coordinates."""
    numbers = lines.numbers(rows)
    short = np.flatnonzero(numbers.counts < width)
    if len(short):
        raise InputError(
            f"{lines.name(int(rows[short[0]]))} holds {numbers.counts[short[0]]} of the {width} coordinates of a"
            " vertex; export the file again."
        )
    vertices = numbers.columns(width)
    if width == 3:
        return np.ascontiguousarray(vertices)
    with np.errstate(all="ignore"):
        return vertices[:, :3] / vertices[:, 3:]


def _corners(lines: TextLines, rows: np.ndarray, numbers: Numbers) -> tuple[np.ndarray, np.ndarray]:
    """Corners of all faces and how many each has; behind them in their lines come colours."""
    says = numbers.values[numbers.first]
    wrong = ~is_whole(says) | (says < 0) | (says >= numbers.counts)
    if wrong.any():
        first = int(np.argmax(wrong))
        raise InputError(
            f"{lines.name(int(rows[first]))} says {says[first]:g} corners but holds {numbers.counts[first] - 1};"
            " export the file again."
        )
    counts = says.astype(np.int64)
    shift = numbers.first + 1 - (np.cumsum(counts) - counts)
    corners = numbers.values[np.repeat(shift, counts) + np.arange(counts.sum())]
    wrong = ~is_whole(corners)
    if wrong.any():
        face = np.searchsorted(np.cumsum(counts), np.argmax(wrong), side="right")
        raise InputError(
            f"{lines.name(rows[face])} holds {corners[np.argmax(wrong)]:g} where an index belongs; export the file"
            " again."
        )
    return corners.astype(np.int64), counts


def _left_over(count: int) -> tuple[str, ...]:
    if count <= 0:
        return ()
    lines = "1 line behind the faces was" if count == 1 else f"{count} lines behind the faces were"
    return (f"{lines} left out: the file's first line does not count {'it' if count == 1 else 'them'}.",)
