"""Archives: the mesh in them is read with what lies beside it, within limits, and nothing is written elsewhere."""

from __future__ import annotations

import bz2
import gzip
import io
import os
import random
import tarfile
import tempfile
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from trimesh import creation

from resfit.errors import InputError
from resfit.shape.formats import archive, read_mesh_file, unpacking

BOX = creation.box().export(file_type="stl")
ZEROS = bytes(4 << 20)

Contents = dict[str, bytes]


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder for temporary files, which must be empty at the end of each test."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setattr(unpacking, "ALWAYS", 1 << 20)
    yield folder
    assert list(folder.iterdir()) == []


def packed_zip(contents: Contents, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as file:
        for name, content in contents.items():
            file.writestr(name, content)
    return stream.getvalue()


def packed_tar(contents: Contents, mode: str = "w") -> bytes:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode=mode) as file:
        for name, content in contents.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            file.addfile(member, io.BytesIO(content))
    return stream.getvalue()


def write(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("x.zip", packed_zip({"a/box.stl": BOX, "readme.txt": b"words", "a/look.png": b"?"})),
        (
            "x.zip",
            packed_zip({"box.STL": BOX, "__MACOSX/._box.stl": b"?", ".hidden.stl": b"?"}, zipfile.ZIP_BZIP2),
        ),
        ("x.tar", packed_tar({"a/box.stl": BOX, "a/notes.md": b"words"})),
        ("x.tar.gz", packed_tar({"box.stl": BOX}, "w:gz")),
        ("x.tgz", packed_tar({"box.stl": BOX}, "w:gz")),
        ("x.tar.bz2", packed_tar({"box.stl": BOX}, "w:bz2")),
        ("x.stl.gz", gzip.compress(BOX)),
        ("x.stl.bz2", bz2.compress(BOX)),
        ("x.gz", gzip.compress(BOX)),
    ],
)
def test_the_mesh_in_an_archive_is_read(tmp_path: Path, name: str, content: bytes) -> None:
    file = read_mesh_file(write(tmp_path, name, content))
    assert (len(file.pieces), len(file.pieces[0].faces), file.reader) == (1, 12, "resfit")
    assert np.ptp(file.pieces[0].vertices, axis=0).tolist() == [1.0, 1.0, 1.0]
    assert "was read from the archive." in file.notes[0]


def test_files_beside_the_mesh_are_found(tmp_path: Path) -> None:
    scene = creation.box().scene()
    path = write(tmp_path, "x.zip", packed_zip(scene.export(file_type="gltf")))
    assert len(read_mesh_file(path).pieces[0].faces) == 12


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (packed_zip({"a.stl": BOX, "b.stl": BOX}), r"holds 2 meshes \(a.stl, b.stl\); unpack it"),
        (packed_zip({f"{k}.stl": BOX for k in range(5)}), r"holds 5 meshes \(0.stl, 1.stl, 2.stl, ...\)"),
        (packed_zip({"a.txt": b"words"}), "holds no mesh file; unpack it"),
        (packed_zip({"a.zip": packed_zip({"a.stl": BOX})}), "only another archive 'a.zip'"),
        (packed_zip({"in/a.stl": BOX[:200]}), "x.zip/in/a.stl' ends in the middle"),
        (packed_zip({"a.stl": BOX})[:-60], "ends in the middle|damaged|no archive"),
        (packed_zip({"../a.stl": BOX}), "holds no mesh file"),
        (packed_zip({"/etc/a.stl": BOX}), "holds no mesh file"),
        (packed_zip({"c:\\a.stl": BOX}), "holds no mesh file"),
        (packed_zip({"a.stl": BOX}, zipfile.ZIP_LZMA), "by a method that is not read here"),
        (packed_zip({"a.stl": ZEROS}), "unpacks to more than 100 times its size"),
        (packed_tar({"a.stl": BOX})[:700], "damaged archive"),
        (packed_tar({"../../a.stl": BOX, "/tmp/b.stl": BOX}), "holds no mesh file"),
        (packed_tar({"a.stl": ZEROS}, "w:gz"), "unpacks to more than 100 times its size"),
        (bz2.compress(ZEROS), "unpacks to more than 100 times its size"),
        (gzip.compress(BOX)[:-20], "damaged archive"),
        (b"These are some words.", "is no archive"),
        (b"", "is no archive"),
    ],
    ids=str,
)  # fmt: skip
def test_what_cannot_be_read_ends_in_one_sentence(tmp_path: Path, content: bytes, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        archive.read(write(tmp_path, "x.zip", content))
    assert "x.zip" in str(caught.value) and str(caught.value).endswith(".")
    assert {path.name for path in tmp_path.iterdir()} == {"x.zip", "temporary"}


def test_encrypted_members_are_refused(tmp_path: Path) -> None:
    content = bytearray(packed_zip({"a.stl": BOX}))
    content[6] |= 1
    content[content.index(b"PK\x01\x02") + 8] |= 1
    with pytest.raises(InputError, match="is encrypted; unpack it"):
        archive.read(write(tmp_path, "x.zip", bytes(content)))


def test_links_and_devices_are_not_made(tmp_path: Path) -> None:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as file:
        for name, kind in (
            ("a.stl", tarfile.SYMTYPE),
            ("b.stl", tarfile.LNKTYPE),
            ("c.stl", tarfile.FIFOTYPE),
        ):
            member = tarfile.TarInfo(name)
            member.type, member.linkname = kind, "/etc/passwd"
            file.addfile(member)
    with pytest.raises(InputError, match="holds no mesh file"):
        archive.read(write(tmp_path, "x.tar", stream.getvalue()))


def test_too_many_files_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (archive, unpacking):
        monkeypatch.setattr(module, "MOST_MEMBERS", 3)
    contents = {f"{k}.stl": BOX for k in range(5)}
    for content in (packed_zip(contents), packed_tar(contents)):
        with pytest.raises(InputError, match="more than 3 files"):
            archive.read(write(tmp_path, "x.zip", content))


def test_folders_left_by_a_killed_process_are_removed(tmp_path: Path, temporary: Path) -> None:
    old, new, other = (temporary / name for name in (f"{archive.PREFIX}old", f"{archive.PREFIX}new", "other"))
    for folder in (old, new, other):
        folder.mkdir()
        (folder / "a.stl").touch()
    past = time.time() - 2 * archive.STALE_SECONDS
    for folder in (old, other):
        os.utime(folder, (past, past))
    archive.read(write(tmp_path, "x.stl.gz", gzip.compress(BOX)))
    assert not old.exists() and new.exists() and other.exists()
    for folder in (new, other):
        (folder / "a.stl").unlink()
        folder.rmdir()


def test_mutated_archives_are_read_or_refused(tmp_path: Path) -> None:
    chance = random.Random(0)
    contents = {"a.stl": BOX, "b.txt": b"words"}
    originals = [packed_zip(contents), packed_tar(contents), packed_tar(contents, "w:gz"), bz2.compress(BOX)]
    for _ in range(400):
        content = bytearray(chance.choice(originals))
        for _ in range(chance.randint(1, 4)):
            at = chance.randrange(len(content))
            content[at : at + chance.choice((0, 1, 1, 9))] = chance.randbytes(chance.choice((0, 1, 1, 4)))
        try:
            archive.read(write(tmp_path, "x.zip", bytes(content)))
        except InputError as error:
            assert "x.zip" in str(error)
