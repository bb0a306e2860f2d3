"""OFF files: all headers, comments and colours, larger polygons, and one sentence for what is damaged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from read_by_trimesh import read_by_trimesh

from resfit.errors import InputError
from resfit.shape.formats.mesh_file import MeshFile
from resfit.shape.formats.off import read
from resfit.shape.load import load_mesh

FIELD_INPUTS = Path(__file__).parents[2] / "data" / "field_inputs"
TRIANGLE = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def read_text(folder: Path, text: str | bytes) -> MeshFile:
    path = folder / "a.off"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read(path)


def test_concave_polygons_are_cut_inside() -> None:
    mesh = load_mesh(FIELD_INPUTS / "off_concave.off")
    assert len(mesh.faces) == 28 and np.ptp(mesh.vertices, axis=0).tolist() == [4, 4, 1]
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).area == pytest.approx(42)


@pytest.mark.parametrize(
    "text",
    [
        "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
        "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2",
        "OFF3 1\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2",
        "# c\n\nOFF # c\n# c\n3 1 0 # c\n\n0 0 0 # c\n1 0 0\n \n\t0 1 0\n# c\n 3 0 1 2 # c\n",
        "COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 255 0 0 255\n0 1 0 255 0 0 255\n3  0 1 2",
        "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 0.5 0.5 0.5 1\n",
        "STCNOFF\n3 1 0\n0 0 0 0 0 1 1 1 1 1 0 0\n1 0 0 0 0 1 1 1 1 1 0 0\n0 1 0 0 0 1 1 1 1 1 0 0\n3 0 1 2",
        "4OFF\n3 1 0\n0 0 0 1\n2 0 0 2\n0 0.5 0 0.5\n3 0 1 2",
        "nOFF\n3\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2",
        "OFF\r3 1 0\r0 0 0\r1 0 0\r0 1 0\r3 0 1 2\r",
        "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".encode("utf-16"),
    ],
)
def test_headers_comments_and_colours(tmp_path: Path, text: str | bytes) -> None:
    file = read_text(tmp_path, text)
    (piece,) = file.pieces
    assert piece.vertices.tolist() == TRIANGLE and piece.faces.tolist() == [[0, 1, 2]]
    assert (file.points, file.lines, file.notes, file.reader) == (0, 0, (), "resfit")


@pytest.mark.parametrize(
    ("faces", "points", "lines", "notes"),
    [
        ("4 3 0\nV2 0 1\n1 0\n3 0 1 2", 1, 1, ()),
        ("4 0 0\nV", 4, 0, ()),
        ("4 1 0\nV2 0 1", 0, 1, ()),
        (
            "4 1 0\nV3 0 1 2\n3 0 1 2",
            0,
            0,
            ("1 line behind the faces was left out: the file's first line does not count it.",),
        ),
    ],
)
def test_what_is_no_face_is_counted(
    tmp_path: Path, faces: str, points: int, lines: int, notes: tuple[str, ...]
) -> None:
    file = read_text(tmp_path, "OFF\n" + faces.replace("V", "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"))
    assert (file.points, file.lines, file.notes) == (points, lines, notes)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("These are some words.\n", "'FILE' is no OFF file"),
        ("OFF BINARY\n\0\0\0\3\0\0\0\1", "'FILE' is a binary OFF file"),
        ("nOFF\n4\n1 1 0\n0 0 0 0\n1 0", "'FILE' holds no shape in three dimensions"),
        ("OFF", "'FILE' does not say after OFF how many"),
        ("OFF\n3\n", "'FILE' does not say after OFF how many"),
        ("OFF\n-3 1 0\n", "'FILE' does not say after OFF how many"),
        ("OFF\nmany vertices\n", "line 2 of 'FILE' holds 'many' where a whole number belongs"),
        ("OFF\n3 9999999999999 0\nV3 0 1 2", "'FILE' says 9999999999999 faces but holds 1;"),
        ("OFF\n3 1 0\nV", "'FILE' says 1 face but holds 0;"),
        ("OFF\n99 1 0\nV3 0 1 2", "'FILE' says 99 vertices but holds 4;"),
        ("OFF\n3 1 0\n0 0 0\n\n1 0\n0 1 0\n3 0 1 2", "line 5 of 'FILE' holds 2 of the 3 coordinates"),
        ("OFF\n3 1 0\n0 0 0\n1 0,5 0\n0 1 0\n3 0 1 2", "line 4 of 'FILE' holds '0,5': write numbers with"),
        ("OFF\n3 1 0\nV4 0 1 2", "line 6 of 'FILE' says 4 corners but holds 3"),
        ("OFF\n3 1 0\nV3 0 1 3", "line 6 of 'FILE' names a vertex that is not among the file's 3"),
        ("OFF\n3 1 0\nV3 0 1 -1", "line 6 of 'FILE' names a vertex"),
        ("OFF\n3 1 0\nV3 0 1 1.5", "line 6 of 'FILE' holds 1.5 where an index belongs"),
        ("OFF\n3 1 0\nVx 0 1 2", "line 6 of 'FILE' holds 'x' where a number belongs"),
    ],
)
def test_a_damaged_file_ends_in_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        read_text(tmp_path, text.replace("V", "0 0 0\n1 0 0\n0 1 0\n"))
    assert str(caught.value).startswith(said.replace("FILE", str(tmp_path / "a.off")))
    assert str(caught.value).endswith(".")


def test_ordinary_files_are_the_same_as_through_trimesh(tmp_path: Path) -> None:
    path = tmp_path / "ball.off"
    trimesh.creation.icosphere(2).export(path)
    (own,), (other,) = read(path).pieces, read_by_trimesh(path).pieces
    assert np.array_equal(own.vertices, other.vertices) and np.array_equal(own.faces, other.faces)
