"""Hostile archives and XML: bombs, entities, paths that lead elsewhere. What they unpack to is at most 0.5 GB."""

from __future__ import annotations

import bz2
import gzip
import io
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Iterator

from fuzz.harness import Case
from fuzz.samples import gltf, put, stl, tetrahedron, zipped

BLOCK = 16 << 20
"""Bytes that are packed once and then repeated."""

BOMB = 32
"""Blocks that a bomb unpacks to: half a gigabyte."""

MODEL = (
    b'<model xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02" unit="millimeter">'
    b'<metadata name="t">%s</metadata><resources/><build/></model>'
)


def zip_bomb(name: str, claim: int | None = None) -> bytes:
    """An archive whose one file unpacks to BOMB blocks of zeros; its directory may claim another size."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    piece = packer.compress(bytes(BLOCK)) + packer.flush(zlib.Z_FULL_FLUSH)
    packed = piece * BOMB + packer.flush()
    check = 0
    for _ in range(BOMB):
        check = zlib.crc32(bytes(BLOCK), check)
    size = BLOCK * BOMB if claim is None else claim
    label = name.encode()
    head = struct.pack("<HHHHHIIIHH", 45, 0, 8, 0, 0, check, len(packed), size, len(label), 0)
    local = b"PK\3\4" + head + label + packed
    central = b"PK\1\2" + struct.pack("<H", 45) + head + struct.pack("<HHHII", 0, 0, 0, 0, 0) + label
    return local + central + b"PK\5\6" + struct.pack("<HHHHIIH", 0, 0, 1, 1, len(central), len(local), 0)


def tarred(content: bytes, mode: str, name: str = "a.stl", kind: bytes = tarfile.REGTYPE) -> bytes:
    """A tar archive of one entry."""
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode=mode) as archive:  # type: ignore[call-overload]
        entry = tarfile.TarInfo(name)
        entry.type, entry.linkname = kind, "/etc/passwd"
        entry.size = len(content)
        archive.addfile(entry, io.BytesIO(content))
    return buffer.getvalue()


def archive_cases() -> Iterator[Case]:
    """ZIP, bzip2 and tar archives."""
    good = stl(tetrahedron())
    yield Case("zip good", zipped(good), "zip")
    yield Case("zip empty", b"PK\5\6" + bytes(18), "zip")
    yield Case("zip without a mesh", zipped(b"hello", "readme.txt"), "zip")
    yield Case("zip to elsewhere", zipped(good, "../../../../tmp/slipped.stl"), "zip")
    yield Case("zip in zip", zipped(zipped(good), "a.zip"), "zip")
    yield Case("zip of bad json", zipped(b"{", "a.json"), "zip")
    yield Case(
        "zip of a glTF with a path",
        zipped(gltf(put("buffers", 0, "uri", "../../etc/passwd")), "a.gltf"),
        "zip",
    )
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for number in range(20000):
            archive.writestr(f"{number}.stl", good if number % 100 == 0 else b"")
    yield Case("zip of 20000 files", buffer.getvalue(), "zip")
    for name in ("a.stl", "a.txt", "a.obj", "a.glb"):
        yield Case(f"zip bomb {name}", zip_bomb(name), "zip")
    yield Case("zip bomb that claims 84 bytes", zip_bomb("a.stl", 84), "zip")
    block = bz2.compress(bytes(BLOCK))
    yield Case("bz2 good", bz2.compress(good), "bz2")
    yield Case("bz2 bomb", block * BOMB, "bz2")
    for suffix in ("gz", "bz2"):
        yield Case(f"tar.{suffix} good", tarred(good, f"w:{suffix}"), f"tar.{suffix}")
        yield Case(f"tar.{suffix} link", tarred(b"", f"w:{suffix}", kind=tarfile.SYMTYPE), f"tar.{suffix}")
        yield Case(
            f"tar.{suffix} to elsewhere", tarred(good, f"w:{suffix}", "../../slipped.stl"), f"tar.{suffix}"
        )
    entry = tarfile.TarInfo("a.stl")
    entry.size = BOMB * BLOCK
    ends = entry.tobuf(), bytes(1024)
    packed = gzip.compress(bytes(BLOCK)) * BOMB
    yield Case("tar.gz bomb", gzip.compress(ends[0]) + packed + gzip.compress(ends[1]), "tar.gz")
    yield Case("tar.bz2 bomb", bz2.compress(ends[0]) + block * BOMB + bz2.compress(ends[1]), "tar.bz2")
    yield Case("gz good", gzip.compress(good), "stl.gz")


def xml_cases() -> Iterator[Case]:
    """XML whose entities grow or lead elsewhere, as 3MF and as what other XML formats are called."""
    head = b'<?xml version="1.0"?>\n<!DOCTYPE l ['
    # Each entity is ten of the one before; the ninth is a gigabyte.
    grow = b'<!ENTITY a "ha">' + b"".join(
        b'<!ENTITY %c "%s">' % (98 + i, b"&%c;" % (97 + i) * 10) for i in range(9)
    )
    # One long entity named often grows by the square, and by no nesting.
    square = b'<!ENTITY j "%s">' % (b"x" * 20000)
    texts = {
        "plain": MODEL % b"x",
        "nested entities": head + grow + b"]>\n" + MODEL % b"&j;",
        "square entities": head + square + b"]>\n" + MODEL % (b"&j;" * 20000),
        "file entity": head + b'<!ENTITY j SYSTEM "file:///etc/passwd">]>\n' + MODEL % b"&j;",
        "net entity": head + b'<!ENTITY j SYSTEM "http://127.0.0.1:9/x">]>\n' + MODEL % b"&j;",
        "deep": b"<a>" * 100000,
        "cut": (MODEL % b"x")[:90],
    }
    for name, text in texts.items():
        yield Case(f"3mf {name}", zipped(text, "3D/3dmodel.model"), "3mf")
        for suffix in ("dae", "amf", "xaml", "3dxml", "svg", "xml"):
            yield Case(f"xml {name} {suffix}", text, suffix)
    yield Case("3mf bomb", zip_bomb("3D/3dmodel.model"), "3mf")
    yield Case("3mf without a model", zipped(b"x", "other"), "3mf")
