"""STL: binary by its length, ASCII as programs write it, and sentences for what is damaged."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
import trimesh
from trimesh import creation

from resfit.errors import InputError
from resfit.shape.formats import stl
from resfit.shape.formats.mesh_file import MeshFile
from resfit.shape.load import load_mesh

DATA = Path(__file__).resolve().parents[2] / "data" / "field_inputs"

TRIANGLE = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1.5e0 0\nendloop\nendfacet\n"


def binary(count: int | None = None, header: bytes = b"", behind: bytes = b"") -> bytes:
    """A box in binary, with a count that may be wrong."""
    content = creation.box().export(file_type="stl")
    written = content[80:84] if count is None else count.to_bytes(4, "little")
    return header.ljust(80) + written + content[84:] + behind


def read(folder: Path, content: bytes | str) -> MeshFile:
    path = folder / "x.stl"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return stl.read(path)


@pytest.mark.parametrize(
    "name", ["stl_trailing.stl", "stl_count0.stl", "stl_ascii_noend.stl", "stl_ascii_cr.stl"]
)
def test_field_inputs_are_unit_boxes(name: str) -> None:
    mesh = load_mesh(DATA / name)
    assert (len(mesh.vertices), len(mesh.faces)) == (8, 12)
    assert np.ptp(mesh.vertices, axis=0).tolist() == [1.0, 1.0, 1.0]
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume == pytest.approx(1.0)


def test_a_binary_file_cut_short_is_refused() -> None:
    with pytest.raises(InputError, match="ends in the middle: it says 12 triangles but holds 10"):
        stl.read(DATA / "stl_trunc.stl")


@pytest.mark.parametrize(
    ("content", "note"),
    [
        (binary(), None),
        (binary(header=b"solid made by a CAD program"), None),
        (binary(header=b"solid facet normal", count=0), "Its header says 0 triangles, its length 12"),
        (binary(0xFFFFFFFF), "Its header says 4294967295 triangles, its length 12"),
        (binary(1), "Its header says 1 triangle, its length 12"),
        (binary(behind=b"xyz"), "3 bytes were left out"),
        (binary(0, behind=b"x"), "1 byte was left out"),
    ],
)
def test_the_length_of_a_binary_file_decides(tmp_path: Path, content: bytes, note: str | None) -> None:
    file = read(tmp_path, content)
    (piece,) = file.pieces
    box = creation.box()
    assert np.array_equal(piece.vertices, box.vertices[box.faces].reshape(-1, 3))
    assert piece.vertices.dtype == np.float64 and piece.faces.dtype == np.int64
    assert any(note in said for said in file.notes) if note else not file.notes


@pytest.mark.parametrize("kind", ["stl", "stl_ascii"])
def test_arrays_are_those_of_trimesh(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "x.stl"
    creation.icosphere(subdivisions=2).export(path, file_type=kind)
    expected = trimesh.load_mesh(path, process=False)
    (piece,) = stl.read(path).pieces
    assert np.array_equal(piece.vertices, expected.vertices.astype(np.float64))
    assert np.array_equal(piece.faces, expected.faces)


@pytest.mark.parametrize(
    ("content", "names", "faces"),
    [
        (f"solid\n{TRIANGLE}endsolid\n", ["mesh"], 1),
        (f"solid left solid\n{TRIANGLE}endsolid\nsolid Right\n{TRIANGLE * 2}", ["left solid", "Right"], 3),
        (f"solid a\nendsolid a\nsolid b\n{TRIANGLE}endsolid", ["b"], 1),
        (f"solid\n{TRIANGLE}endsolid\nsolid\n{TRIANGLE}endsolid", ["solid 1", "solid 2"], 2),
        (f"SOLID Up\n{TRIANGLE.upper()}ENDSOLID Up\n", ["Up"], 1),
        (f"\ufeffsolid bom\n{TRIANGLE}", ["bom"], 1),
        (f"  solid facet vertex\n{TRIANGLE}endsolid facet vertex\n", ["facet vertex"], 1),
        (f"solid tab\n{TRIANGLE}".replace(" ", "\t").replace("\n", "\n\t"), ["tab"], 1),
        (f"solid cr\n{TRIANGLE}".replace("\n", "\r"), ["cr"], 1),
        (f"solid one line\n{TRIANGLE}".replace("\n", " "), ["one line"], 1),
        (f"solid wide\n{TRIANGLE}".encode("utf-16"), ["wide"], 1),
        (f"solid\n{TRIANGLE}endsolid\n" * 1001, ["mesh"], 1001),
        ("solid nothing\nendsolid nothing\n", [], 0),
        ("These are some words,\nnot a mesh.\n", [], 0),
    ],
)
def test_ascii_as_programs_write_it(
    tmp_path: Path, content: str | bytes, names: list[str], faces: int
) -> None:
    pieces = read(tmp_path, content).pieces
    assert [piece.name for piece in pieces] == names
    assert sum(len(piece.faces) for piece in pieces) == faces
    for piece in pieces:
        assert piece.vertices.reshape(-1, 3, 3)[-1].tolist() == [[0, 0, 0], [1, 0, 0], [0, 1.5, 0]]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (f"solid\n{TRIANGLE}".replace("1.5e0", "1,5"), r"numbers with commas \('1,5'\)"),
        (f"solid\n{TRIANGLE}".replace("1.5e0", "one"), "'one' in place of a coordinate"),
        (f"solid\n{TRIANGLE[:50]}", "ends in the middle of a facet"),
        (f"solid\n{TRIANGLE[:-40]}", "ends in the middle of a facet"),
        (f"solid\n{TRIANGLE}".replace("endloop", "vertex 1 1 1\nendloop"), "more than three corners"),
        (b"\0" * 50, "too short for an STL file"),
    ],
)
def test_damaged_files_end_in_one_sentence(tmp_path: Path, content: str | bytes, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        read(tmp_path, content)
    assert "x.stl" in str(caught.value) and str(caught.value).endswith(".")


def test_mutated_files_are_read_or_refused(tmp_path: Path) -> None:
    chance = random.Random(0)
    originals = [binary(), f"solid a\n{TRIANGLE * 3}endsolid a\nsolid b\n{TRIANGLE}".encode()]
    for _ in range(500):
        content = bytearray(chance.choice(originals))
        for _ in range(chance.randint(1, 4)):
            at = chance.randrange(len(content))
            content[at : at + chance.choice((0, 1, 9))] = chance.randbytes(chance.choice((0, 1, 4)))
        try:
            file = read(tmp_path, bytes(content))
        except InputError as error:
            assert "x.stl" in str(error)
        else:
            assert all(piece.vertices.shape == (3 * len(piece.faces), 3) for piece in file.pieces)


@pytest.mark.parametrize("lost", ["endfacet", "facet", "t"])
def test_an_ascii_file_cut_within_its_last_facet_is_refused(tmp_path: Path, lost: str) -> None:
    facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet"
    path = tmp_path / "cut.stl"
    path.write_text(f"solid x\n{facet}\n{facet}".removesuffix(lost))
    with pytest.raises(InputError, match="ends in the middle of a facet"):
        stl.read(path)
