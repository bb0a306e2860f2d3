"""PLY files: text and binary of both orders, all types and lists, strips, and one sentence for what is damaged."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from read_by_trimesh import read_by_trimesh

from resfit.errors import InputError
from resfit.shape.formats.mesh_file import MeshFile
from resfit.shape.formats.ply import read
from resfit.shape.load import load_mesh

FIELD_INPUTS = Path(__file__).parents[2] / "data" / "field_inputs"
SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
POINTS = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
LIST = "property list uchar int vertex_indices\n"
TEXT = "ply\nformat ascii 1.0\n"
CODES = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f",
    "float64": "d", "int64": "q", "uint64": "Q",
}  # fmt: skip


def read_bytes(folder: Path, data: str | bytes) -> MeshFile:
    path = folder / "a.ply"
    path.write_bytes(data.encode("latin-1") if isinstance(data, str) else data)
    return read(path)


def encode(form: str, elements: str, records: list[list[tuple[str, float]]], end: str = "\n") -> bytes:
    """A PLY file: `records` hold (type, number), those of lists after their length."""
    header = f"ply\nformat {form} 1.0\n{elements}end_header\n".replace("\n", end).encode()
    if form == "ascii":
        return header + end.join(" ".join(str(number) for _, number in row) for row in records).encode()
    order = "<" if "little" in form else ">"
    packed = [struct.pack(order + CODES[kind], number) for row in records for kind, number in row]
    return header + b"".join(packed)


@pytest.mark.parametrize("name", ["ply_mixed.ply", "ply_faceextra.ply", "ply_strips.ply"])
def test_boxes_as_programs_write_them(name: str) -> None:
    mesh = load_mesh(FIELD_INPUTS / name)
    assert len(mesh.faces) == 12 and np.ptp(mesh.vertices, axis=0).tolist() == [1, 1, 1]
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume == pytest.approx(1)
    assert mesh.notes == ()


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize(
    ("position", "index", "length"),
    [
        ("float", "int", "uchar"),
        ("double", "uint", "int"),
        ("float64", "uint8", "uint8"),
        ("short", "int16", "ushort"),
        ("int8", "char", "int8"),
        ("int64", "uint64", "uint32"),
        ("float32", "ushort", "short"),
        ("uint16", "float", "float"),
    ],
)
def test_types_orders_and_everything_beside(
    tmp_path: Path, form: str, end: str, position: str, index: str, length: str
) -> None:
    elements = (
        f"comment c\nobj_info i\nelement user 2\nproperty list {length} double a\nproperty int b\n"
        "property list uchar uchar c\nelement face 3\nproperty uchar red\n"
        f"property list {length} {index} vertex_index\nproperty list uchar float texcoord\n"
        f"element vertex 4\nproperty {position} z\nproperty uchar red\nproperty {position} y\n"
        f"property {position} x\nelement edge 1\nproperty int vertex1\nproperty int vertex2\n"
    )
    faces = [[0, 1, 2], [0, 1, 2, 3], [3, 1, 2]]
    records = [
        [(length, 2), ("double", 0.5), ("double", 0.25), ("int", 13), ("uchar", 1), ("uchar", 10)],
        [(length, 0), ("int", -1), ("uchar", 3), ("uchar", 13), ("uchar", 10), ("uchar", 0)],
        *(
            [("uchar", 7), (length, len(face)), *((index, corner) for corner in face), ("uchar", number)]
            + [("float", 0.5)] * number
            for number, face in enumerate(faces)
        ),
        *([(position, z), ("uchar", 255), (position, y), (position, x)] for x, y, z in SQUARE),
        [("int", 0), ("int", 1)],
    ]
    file = read_bytes(tmp_path, encode(form, elements, records, end))
    (piece,) = file.pieces
    assert piece.vertices.tolist() == SQUARE
    assert piece.faces.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3], [3, 1, 2]]
    assert (file.points, file.lines, file.notes) == (0, 1, ())


def test_mixed_polygons_keep_their_order(tmp_path: Path, rng: np.random.Generator) -> None:
    counts = np.concatenate([np.full(20, 4), rng.integers(0, 6, 200), np.full(20, 3)])
    corner = rng.permutation(1000)
    faces = [corner[np.arange(count) + start].tolist() for start, count in enumerate(counts)]
    # A circle: whatever the corners are, sorted ones make a convex polygon.
    faces = [sorted(face) for face in faces]
    angle = np.arange(1000) * 2 * np.pi / 1000
    header = POINTS.replace("4", "1000").replace("float", "double") + f"element face {len(faces)}\n"
    records = [[("double", np.cos(a)), ("double", np.sin(a)), ("double", 0)] for a in angle.tolist()]
    records += [[("uchar", len(face)), *(("int", index) for index in face)] for face in faces]
    file = read_bytes(tmp_path, encode("binary_little_endian", header + LIST, records))
    fans = [[face[0], face[k], face[k + 1]] for face in faces for k in range(1, len(face) - 1)]
    assert file.pieces[0].faces.tolist() == fans
    assert (file.points, file.lines) == (int((counts == 1).sum()), int((counts == 2).sum()))


@pytest.mark.parametrize("kind", ["int", "uint", "short", "float"])
def test_strips_turn_every_second_triangle_and_begin_anew(tmp_path: Path, kind: str) -> None:
    restart = 2**32 - 1 if kind == "uint" else -1
    strips = [[0, 1, 3, 2, restart, 1, 2, 0, restart, restart, 3, 3, 0, 1], [], [2, 3], [1, 2, 3]]
    header = POINTS + f"element tristrips 4\nproperty list int {kind} vertex_indices\n"
    records = [[("float", value) for value in row] for row in SQUARE]
    records += [[("int", len(strip)), *((kind, index) for index in strip)] for strip in strips]
    file = read_bytes(tmp_path, encode("binary_big_endian", header, records))
    assert file.pieces[0].faces.tolist() == [[0, 1, 3], [3, 1, 2], [1, 2, 0], [0, 3, 1], [1, 2, 3]]


def test_the_largest_index_of_a_small_type_is_a_vertex(tmp_path: Path) -> None:
    header = POINTS.replace("4", "256") + "element face 1\nproperty list uchar uchar vertex_indices\n"
    records = [[("float", float(k)), ("float", float(k % 2)), ("float", 0.0)] for k in range(256)]
    records += [[("uchar", 3), ("uchar", 0), ("uchar", 1), ("uchar", 255)]]
    file = read_bytes(tmp_path, encode("binary_little_endian", header, records))
    assert file.pieces[0].faces.tolist() == [[0, 1, 255]]


@pytest.mark.parametrize(
    ("data", "points", "lines", "notes"),
    [
        (POINTS + "end_header\nV", 4, 0, ()),
        (POINTS + "element face 0\n" + LIST + "end_header\nV", 4, 0, ()),
        (POINTS + "element edge 2\nproperty int vertex1\nend_header\nV0\n1\n", 0, 2, ()),
        (POINTS + "element face 2\n" + LIST + "end_header\nV2 0 1\n1 0", 1, 1, ()),
        (POINTS + "element odd 99999999999\nend_header\nV", 4, 0, ()),
        (
            POINTS + "element face 1\n" + LIST + "end_header\nV3 0 1 2\n3 1 2 3\n",
            0,
            0,
            ("4 numbers behind the last record were left out.",),
        ),
    ],
)
def test_what_is_no_face_is_counted(
    tmp_path: Path, data: str, points: int, lines: int, notes: tuple[str, ...]
) -> None:
    file = read_bytes(tmp_path, TEXT + data.replace("V", "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"))
    assert (file.points, file.lines, file.notes) == (points, lines, notes)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ("These are some words.\n", "'FILE' is no PLY file"),
        ("ply", "'FILE' ends in its header"),
        (TEXT + "element vertex 4\n", "'FILE' ends in its header"),
        ("ply\nformat binary 1.0\nend_header\n", "line 2 of 'FILE' is no line of a PLY header"),
        (TEXT + "element vertex many\nend_header\n", "line 3 of 'FILE' is no line of a PLY header"),
        (TEXT + "property float x\nend_header\n", "line 3 of 'FILE' is no line of a PLY header"),
        (TEXT + "element vertex 1\nproperty real x\nend_header\n", "line 4 of 'FILE' is no line of a PLY"),
        (TEXT + "end_header\n", "'FILE' holds no vertices with x, y and z"),
        (TEXT + "element vertex 1\nproperty float x\nend_header\n1", "'FILE' holds no vertices with x, y"),
        (TEXT + POINTS + "end_header\n0 0 0\n1 0 0\n1 1", "'FILE' says 4 vertices but holds 2;"),
        (TEXT + POINTS + "F 3end_header\nV3 0 1 2\n3 1 2", "'FILE' says 3 faces but holds 1;"),
        (TEXT + POINTS + "F 1end_header\nV", "'FILE' says 1 face but holds 0;"),
        (TEXT + POINTS + "F 999999999999999end_header\nV3 0 1 2", "'FILE' says 999999999999999 faces but"),
        (
            TEXT + POINTS + "element a\x1b 2\nproperty int b\nend_header\nV1",
            "'FILE' says 2 records of 'a?' but",
        ),
        (TEXT + POINTS + "F 1end_header\nV3 0 1 4", "line 14 of 'FILE' names a vertex that is not among the"),
        (
            TEXT + POINTS + "F 1end_header\nV3 0 1 -1",
            "line 14 of 'FILE' names a vertex that is not among the",
        ),
        (TEXT + POINTS + "F 1end_header\nV3 0 1 0.5", "line 14 of 'FILE' holds 0.5 where an index belongs"),
        (TEXT + POINTS + "F 1end_header\nV3 0 1 x", "line 14 of 'FILE' holds 'x' where a number belongs"),
        (TEXT + POINTS + "F 1end_header\nV-3 0 1 2", "a list of 'face' in 'FILE' has -3 values"),
        (TEXT + POINTS + "F 1end_header\nVnan 0 1 2", "a list of 'face' in 'FILE' has nan values"),
        (
            TEXT + POINTS + "element face 1\nproperty int a\nend_header\nV0",
            "the 'face' records of 'FILE' have",
        ),
        (
            BINARY := "ply\nformat binary_little_endian 1.0\n" + POINTS + "end_header\n",
            "'FILE' says 4 vertices but",
        ),
        (
            BINARY.replace("end_header", "F 1end_header") + "\0" * 48 + "\3" + "\1\0\0\0" * 2 + "\5\0\0\0",
            "face 1 of 'FILE' names a vertex that is not among the file's 4",
        ),
    ],
)
def test_a_damaged_file_ends_in_one_sentence(tmp_path: Path, data: str, said: str) -> None:
    data = data.replace("V", "0 0 0\n1 0 0\n1 1 0\n0 1 0\n")
    for count in ("1", "3", "999999999999999"):
        data = data.replace(f"F {count}end", f"element face {count}\n{LIST}end")
    with pytest.raises(InputError) as caught:
        read_bytes(tmp_path, data)
    assert str(caught.value).startswith(said.replace("FILE", str(tmp_path / "a.ply")))
    assert str(caught.value).endswith(".")


def test_every_cut_of_a_binary_file_is_noticed(tmp_path: Path) -> None:
    data = (FIELD_INPUTS / "ply_mixed.ply").read_bytes()
    for length in range(3, len(data)):
        with pytest.raises(InputError, match=r"ends in (its header|the middle)"):
            read_bytes(tmp_path, data[:length])


@pytest.mark.parametrize("encoding", ["binary", "ascii"])
def test_ordinary_files_are_the_same_as_through_trimesh(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "ball.ply"
    path.write_bytes(trimesh.exchange.ply.export_ply(trimesh.creation.icosphere(2), encoding=encoding))
    (own,), (other,) = read(path).pieces, read_by_trimesh(path).pieces
    # Text keeps all its digits here; trimesh rounds it to the type that the header names.
    assert np.array_equal(own.vertices.astype(np.float32), other.vertices.astype(np.float32))
    assert np.array_equal(own.faces, other.faces)
