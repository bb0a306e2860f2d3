"""OBJ files: every way to write a polygon, the names of pieces, and one sentence with the line for what is damaged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from read_by_trimesh import read_by_trimesh

from resfit.errors import InputError
from resfit.shape.formats.mesh_file import MeshFile
from resfit.shape.formats.obj import read
from resfit.shape.load import load_mesh

FIELD_INPUTS = Path(__file__).parents[2] / "data" / "field_inputs"
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def read_text(folder: Path, text: str | bytes) -> MeshFile:
    path = folder / "a.obj"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read(path)


@pytest.mark.parametrize(
    ("name", "size", "faces", "area", "parts"),
    [
        ("obj_relative.obj", (4, 2, 1), 24, 16, ["one", "two"]),
        ("obj_concave2.obj", (4, 4, 1), 28, 42, ["mesh"]),
        ("obj_tabs.obj", (1, 1, 1), 12, 6, ["mesh"]),
        ("obj_cr.obj", (1, 1, 1), 12, 6, ["mesh"]),
        ("obj_bom.obj", (1, 1, 1), 12, 6, ["mesh"]),
        ("obj_comment.obj", (1, 1, 1), 12, 6, ["mesh"]),
        ("obj_materials.obj", (1, 1, 1), 12, 6, ["mesh"]),
        ("obj_objects.obj", (4, 2, 1), 24, 16, ["left", "right"]),
        ("house.obj", (6.4, 4.6, 3.2), 144, None, ["slab", "front", "back", "left", "right"]),
    ],
)
def test_files_as_programs_write_them(
    name: str, size: tuple[float, ...], faces: int, area: float | None, parts: list[str]
) -> None:
    mesh = load_mesh(FIELD_INPUTS / name)
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx(size)
    assert len(mesh.faces) == faces
    assert [part.name for part in mesh.parts] == parts
    assert mesh.notes == ()
    if area is not None:
        assert trimesh.Trimesh(mesh.vertices, mesh.faces).area == pytest.approx(area)


@pytest.mark.parametrize(
    ("text", "faces"),
    [
        ("f 1 2 3", [[0, 1, 2]]),
        ("f 1/9/9 2/9 3//9", [[0, 1, 2]]),
        ("f -4 -3 -2", [[0, 1, 2]]),
        ("f -4 2 -2/-1", [[0, 1, 2]]),
        ("  f\t1  2\t3 ", [[0, 1, 2]]),
        ("f 1 2 3 # 4", [[0, 1, 2]]),
        ("f 1 2 \\\n3 4", [[0, 1, 2], [0, 2, 3]]),
        ("f 1 \\\n2 \\\n3", [[0, 1, 2]]),
        ("f 1 2 3 \\\n", [[0, 1, 2]]),
        ("# a comment that ends with \\\nf 1 2 3", [[0, 1, 2]]),
        ("g a name that ends with \\\nf 1 2 3", [[0, 1, 2]]),
        ("f 1 2 3 4\nf 1 2 3", [[0, 1, 2], [0, 2, 3], [0, 1, 2]]),
        ("f 5 1 2\nv 9 9 9", [[4, 0, 1]]),
        ("v 9 9 9 1 # colours follow\nv 9 9 9 0.5 0.5 0.5\nvn 1 0 0\nvt x\nf 1 2 -1", [[0, 1, 5]]),
        ("usemtl a\nf 1 2 3\nusemtl b\nf 2 3 4\ns 1\nf 1 2 4", [[0, 1, 2], [1, 2, 3], [0, 1, 3]]),
        ("f 1 2 3\nv 9 9 9\nf -1 -2 -3", [[0, 1, 2], [4, 3, 2]]),
    ],
)
def test_faces(tmp_path: Path, text: str, faces: list[list[int]]) -> None:
    file = read_text(tmp_path, SQUARE + text)
    assert [piece.faces.tolist() for piece in file.pieces] == [faces]
    assert np.array_equal(file.pieces[0].vertices[:4], [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    assert (file.points, file.lines, file.notes) == (0, 0, ())


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("o a\nF\no b\nF\no a\nF", ["a", "b", "a"]),
        ("F\no a\nF", ["mesh", "a"]),
        ("o a\nF\no empty\no a\nF", ["a"]),
        ("g a\nF\ng b c\nF\ng\nF", ["a", "b c", "mesh"]),
        ("o a\ng x\nF\ng y\nF\no b\ng x\nF", ["a", "b"]),
        ("o all\ng x\nF\ng y\nF", ["x", "y"]),
        ("o all\ng x\nF\nF", ["all"]),
        ("g x\nF\nF", ["x"]),
        ("usemtl a\nF\nusemtl b\nF", ["mesh"]),
        ("g a#1\nF\ng T\xfcr\nF", ["a#1", "T\xfcr"]),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
def test_pieces_are_objects_or_groups(tmp_path: Path, text: str, names: list[str], encoding: str) -> None:
    file = read_text(tmp_path, (SQUARE + text.replace("F", "f 2 3 4")).encode(encoding))
    assert [piece.name for piece in file.pieces] == names
    assert sum(len(piece.faces) for piece in file.pieces) == text.count("F")
    for piece in file.pieces:
        assert piece.vertices[piece.faces[0]].tolist() == [[1, 0, 0], [1, 1, 0], [0, 1, 0]]


@pytest.mark.parametrize(
    ("text", "points", "lines", "notes"),
    [
        ("", 4, 0, ()),
        ("p 1 2\np 3", 4, 0, ()),
        ("l 1 2 3/1\nl 3 4", 0, 3, ()),
        ("f 1 2\nf 1\nf", 1, 1, ()),
        ("f 1 2 3\np 1 2\nl 1 2", 2, 1, ()),
        ("f 1 2 3\nsurf 0 1 0 1 1\nend", 0, 0, ("1 freeform curve or surface was left out.",)),
        ("f 1 2 3\ncurv 0 1 1\ncurv 0 1 1", 0, 0, ("2 freeform curves and surfaces were left out.",)),
        ("f 1 2 3\ncall b.obj", 0, 0, ("The files that the OBJ file calls were not read.",)),
    ],
)
def test_what_is_no_face_is_counted(
    tmp_path: Path, text: str, points: int, lines: int, notes: tuple[str, ...]
) -> None:
    file = read_text(tmp_path, SQUARE + text)
    assert (file.points, file.lines, file.notes) == (points, lines, notes)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("f 1 2 9", "line 5 of 'FILE' names a vertex that is not among the file's 4"),
        ("\nf 1 2 -9", "line 6 of 'FILE' names a vertex"),
        ("f 0 1 2", "line 5 of 'FILE' names vertex 0, but OBJ counts from 1"),
        ("f 1 2 x", "line 5 of 'FILE' holds 'x' where a whole number belongs"),
        ("f 1 2 /3", "line 5 of 'FILE' holds '/3'"),
        ("f 1 2.5 3", "line 5 of 'FILE' holds '2.5'"),
        ("f 1 2 99999999999999999999", "line 5 of 'FILE' names a vertex"),
        ("f 1 \\\n2 3\nf 1 2 9", "line 7 of 'FILE'"),
        ("v 1 2\nf 1 2 3", "line 5 of 'FILE' holds 2 numbers where a vertex needs 3"),
        ("v\nf 1 2 3", "line 5 of 'FILE' holds 0 numbers"),
        ("v 1,5 2 3\nf 1 2 3", "line 5 of 'FILE' holds '1,5': write numbers with a decimal point"),
        ("v 1 2 three\nf 1 2 3", "line 5 of 'FILE' holds 'three' where a number belongs"),
        ("cstype bspline\nsurf 0 1 0 1 1 2 3 4", "'FILE' holds 1 freeform curve or surface but no faces"),
    ],
)
def test_a_damaged_file_ends_in_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        read_text(tmp_path, SQUARE + text)
    assert str(caught.value).startswith(said.replace("FILE", str(tmp_path / "a.obj")))
    assert str(caught.value).endswith(".")


def test_coordinates_that_are_not_finite_are_refused_by_name(tmp_path: Path) -> None:
    read_text(tmp_path, SQUARE + "v nan 0 0\nf 1 2 3 4 5\n")
    with pytest.raises(InputError, match="not finite"):
        load_mesh(tmp_path / "a.obj")


def test_ordinary_files_are_the_same_as_through_trimesh(tmp_path: Path) -> None:
    path = tmp_path / "ball.obj"
    trimesh.creation.icosphere(2).export(path)
    (own,), (other,) = read(path).pieces, read_by_trimesh(path).pieces
    assert np.array_equal(own.vertices[own.faces], other.vertices[other.faces])
