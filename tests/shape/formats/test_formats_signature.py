"""Files whose content is not what their name says, formats that are not read, and the list of those that are."""

from __future__ import annotations

import gzip
import os
import re
import socket
import zipfile
from pathlib import Path

import pytest
import trimesh
from trimesh import creation

from resfit.cli.fit import fit
from resfit.errors import InputError
from resfit.shape.formats import MESH_SUFFIXES, PACKED, READERS, read_mesh_file
from resfit.shape.formats.foreign import FOREIGN
from resfit.shape.formats.signature import kind_of
from resfit.shape.load import load_mesh

KINDS = ("glb", "ply", "stl", "stl_ascii", "off", "gltf")


def exported(kind: str) -> bytes:
    """A box in a format of trimesh."""
    if kind == "gltf":
        return b'{"asset": {"version": "2.0"}}'
    content = creation.box().export(file_type=kind)
    return content.encode() if isinstance(content, str) else content


def write(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_formats_are_told_by_their_content(tmp_path: Path, kind: str) -> None:
    assert kind_of(write(tmp_path, "x", exported(kind))) == kind.removesuffix("_ascii")


@pytest.mark.parametrize(
    "content", [b"v 0 0 0\nv 1 0 0\nf 1 2 3\n", b"words", b"solid words", b"", bytes(200), exported("obj")]
)
def test_what_has_no_signature_is_not_told(tmp_path: Path, content: bytes) -> None:
    assert kind_of(write(tmp_path, "x", content)) is None


@pytest.mark.parametrize(
    ("kind", "suffix"), [("stl", "obj"), ("stl", "glb"), ("stl_ascii", "ply"), ("stl", "dae")]
)
def test_a_file_is_read_by_what_it_is(tmp_path: Path, kind: str, suffix: str) -> None:
    mesh = load_mesh(write(tmp_path, f"x.{suffix}", exported(kind)))
    assert len(mesh.faces) == 12
    assert mesh.notes[0] == f"Its name ends in .{suffix}, but its content is STL."


def test_a_packed_mesh_without_the_suffix_is_read(tmp_path: Path) -> None:
    assert len(load_mesh(write(tmp_path, "x.stl", gzip.compress(exported("stl")))).faces) == 12


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("x.glb", b"<!DOCTYPE html><html>404</html>", "is a page of HTML and not the mesh; download the file itself"),
        ("x.stl", b"\xef\xbb\xbf\n<HTML lang='en'>", "is a page of HTML"),
        ("x.obj", b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "fetch it by 'git lfs pull'"),
        ("x.stl", b"Kaydara FBX Binary  \x00", "export GLB"),
        ("x.obj", b"ISO-10303-21;\nHEADER;", "is a CAD model and not a mesh; .* export STL"),
        ("x.step", b"ISO-10303-21;\nHEADER;", "is a CAD model"),
        ("x.dae", b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><COLLADA/>', "is of a format that is not read"),
        ("x.glb", b'<?xml version="1.0"?>\n<COLLADA xmlns="urn">', "is of a format that is not read"),
        ("x.xyz", b"0 0 0\n1 0 0\n", "is a point cloud without faces"),
        ("x.dxf", b"0\nSECTION\n", "is a drawing"),
        ("x.usdz", b"PK\x03\x04", "is of a format that is not read"),
        ("x.mtl", b"newmtl red\n", "holds only materials"),
        ("x.ply", b"\x89PNG\r\n\x1a\n", "is a picture"),
        ("x.zip", b"Rar!\x1a\x07\x01\x00", "unpack it and give the mesh in it"),
        ("x.xyzzy", b"words", "'.xyzzy', which is no mesh format known here"),
        ("x", b"words", "no suffix, which is no mesh format known here"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_refused_by_its_name(
    tmp_path: Path, name: str, content: bytes, said: str
) -> None:
    with pytest.raises(InputError, match=said) as caught:
        load_mesh(write(tmp_path, name, content))
    assert f"{name}'" in str(caught.value) and str(caught.value).endswith(".")


def test_a_zip_named_3mf_without_a_model_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "x.3mf", "w") as file:
        file.writestr("a.stl", exported("stl"))
    with pytest.raises(InputError, match="is a ZIP archive without a 3D model"):
        load_mesh(tmp_path / "x.3mf")


def test_only_regular_files_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo.stl")
    listener = socket.socket(socket.AF_UNIX)
    here = Path.cwd()
    try:
        # The name of a socket is short.
        os.chdir(tmp_path)
        listener.bind("socket.stl")
    finally:
        os.chdir(here)
        listener.close()
    (tmp_path / "link.stl").symlink_to("/dev/zero")
    for name in ("fifo.stl", "socket.stl", "link.stl"):
        with pytest.raises(InputError, match=f"{name}' is a pipe or device, not a regular file"):
            load_mesh(tmp_path / name)


@pytest.mark.parametrize("suffix", sorted(set(READERS) - PACKED - {"3mf", "gltf"}))
def test_every_format_that_is_offered_is_read(tmp_path: Path, suffix: str) -> None:
    path = write(tmp_path, f"x.{suffix}", exported(suffix))
    assert sum(len(piece.faces) for piece in read_mesh_file(path).pieces) == 12
    (piece,) = read_mesh_file(write(tmp_path, f"x.{suffix}.gz", gzip.compress(path.read_bytes()))).pieces
    assert len(piece.faces) == 12


def test_gltf_is_read(tmp_path: Path) -> None:
    for name, content in trimesh.Scene(creation.box()).export(file_type="gltf").items():
        write(tmp_path, name, content)
    assert len(load_mesh(tmp_path / "model.gltf").faces) == 12


def test_the_help_names_the_formats_that_are_read() -> None:
    line = next(line for line in (fit.__doc__ or "").splitlines() if line.strip().startswith("meshes:"))
    named = re.findall(r"\.(\w+)", line)
    assert sorted(named) == sorted(READERS)
    assert not set(READERS) & set(FOREIGN)
    assert set(MESH_SUFFIXES) == {f".{suffix}" for suffix in READERS} - {f".{suffix}" for suffix in PACKED}
