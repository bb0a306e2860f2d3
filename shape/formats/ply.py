"""Polygon File Format (PLY), text and binary: polygons and triangle strips. Colours and the like are passed over."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from resfit.errors import InputError

from .indexed import check_held, cut_polygons
from .mesh_file import MeshFile, Piece
from .ply_header import read_header
from .ply_records import Records, place_records
from .text import TextLines, is_whole, plain_text, printable

CORNERS = ("vertex_indices", "vertex_index")
"""Names of the list of a polygon's or a strip's corners."""

NAMES = {"vertex": ("vertex", "vertices"), "face": ("face", "faces")}
"""What messages call one and several records of an element, where it is not by its name."""

RESTART = -1
"""The index in a triangle strip at which another one begins."""


def read(path: Path) -> MeshFile:
    """The polygons and triangle strips of a PLY file.

    Raises:
        InputError: if it is no PLY file, or damaged, or ends in the middle.
    """
    where = f"'{path}'"
    data: bytes | memoryview = path.read_bytes()
    data = data if data.startswith(b"ply") else plain_text(data)
    header = read_header(data, where)
    lines, position, of_line = None, header.size, np.zeros(0, np.int64)
    if header.is_text:
        # Records of text are records of doubles.
        lines = TextLines(plain_text(data[header.size :]), where, header.lines + 1)
        numbers = lines.numbers(np.arange(len(lines.ends)))
        data, position, of_line = numbers.values.view(np.uint8).data, 0, 8 * numbers.first
    found: dict[str, Records] = {}
    for element in header.elements.values():
        records = found[element.name] = place_records(data, position, element, where)
        if element.properties:
            name = f"of '{printable(element.name)}'"
            what = NAMES.get(element.name, (f"record {name}", f"records {name}"))
            check_held(where, element.count, len(records.starts), what)
        position = records.end
    vertices = _vertices(found.get("vertex"), where)

    def name_face(index: int) -> str:
        if lines is None:
            return f"face {index + 1} of {where}"
        byte = found["face"].starts[index]
        return lines.name(int(np.searchsorted(of_line, byte, side="right")) - 1)

    corners, counts = _lists(found.get("face"), where, name_face)
    polygons = cut_polygons(vertices, corners, counts, name_face)
    triangles = _strip_triangles(*_lists(found.get("tristrips"), where, lambda _: f"a strip of {where}"))
    strips = cut_polygons(
        vertices, triangles.reshape(-1), np.full(len(triangles), 3), lambda _: f"a strip of {where}"
    )
    faces = np.concatenate([polygons.faces, strips.faces])
    edges = polygons.lines + (len(found["edge"].starts) if "edge" in found else 0)
    points = polygons.points if len(faces) or edges else len(vertices)
    notes = _left_over(data[position:], header.is_text)
    return MeshFile((Piece("mesh", vertices, faces),), "resfit", points, edges, notes)


def _vertices(records: Records | None, where: str) -> np.ndarray:
    """Positions (n, 3)."""
    entries = [records.element.find(axis) if records else None for axis in "xyz"]
    if records is None or any(entry is None or entry.length is not None for entry in entries):
        raise InputError(f"{where} holds no vertices with x, y and z; export it as a triangle mesh.")
    return np.stack([records.values(entry) for entry in entries if entry is not None], axis=1)


def _lists(records: Records | None, where: str, name: Callable[[int], str]) -> tuple[np.ndarray, np.ndarray]:
    """Corners of all polygons or strips, one after the other, and how many each has."""
    if records is None or not records.element.count:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    entry = records.element.find(*CORNERS)
    if entry is None or entry.length is None:
        raise InputError(
            f"the '{records.element.name}' records of {where} have no list {CORNERS[0]}; export it as a triangle mesh."
        )
    corners, counts = records.lists(entry)
    if corners.dtype.kind == "f":
        with np.errstate(invalid="ignore"):
            wrong = ~is_whole(corners.astype(np.float64))
        if wrong.any():
            first = int(np.argmax(wrong))
            record = int(np.searchsorted(np.cumsum(counts), first, side="right"))
            raise InputError(
                f"{name(record)} holds {corners[first]:g} where an index belongs; export the file again."
            )
    if corners.dtype.kind == "u" and corners.dtype.itemsize >= 4:
        # -1 is written into types without a sign, too.
        return corners.view(f"i{corners.dtype.itemsize}").astype(np.int64), counts
    return corners.astype(np.int64), counts


def _strip_triangles(corners: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Triangles (m, 3) of strips: every second one is turned, and those that only join strips are left out."""
    places = np.arange(len(corners))
    begins = corners == RESTART
    begins = np.concatenate([np.zeros(min(1, len(begins)), bool), begins[:-1]])
    begins[(np.cumsum(counts) - counts)[counts > 0]] = True
    start = np.maximum.accumulate(np.where(begins, places, 0))
    rows = np.stack([np.roll(corners, -step) for step in range(3)], axis=1)[: max(len(corners) - 2, 0)]
    turned = (places - start)[: len(rows)] % 2 == 1
    rows[turned] = rows[turned][:, [1, 0, 2]]
    kept = (start[: len(rows)] == start[2:][: len(rows)]) & (rows != RESTART).all(axis=1)
    kept &= (rows[:, 0] != rows[:, 1]) & (rows[:, 1] != rows[:, 2]) & (rows[:, 2] != rows[:, 0])
    return rows[kept]


def _left_over(rest: bytes | memoryview, is_text: bool) -> tuple[str, ...]:
    count = len(rest) // 8 if is_text else len(bytes(rest).strip(b"\0 \t\r\n"))
    if not count:
        return ()
    what = "number" if is_text else "byte"
    some = (
        f"1 {what} behind the last record was"
        if count == 1
        else f"{count} {what}s behind the last record were"
    )
    return (f"{some} left out.",)
