"""File type by signature: the first bytes, whatever the name says."""

from __future__ import annotations

import re
from pathlib import Path

HEAD = 4096
CONTAINERS = frozenset(("zip", "tar", "gz", "bz2", "7z", "rar", "xz", "zst"))
"""Kinds in which other formats are packed."""

_BEGINNINGS = (
    (b"glTF", "glb"),
    (b"ply\n", "ply"),
    (b"ply\r", "ply"),
    (b"PK\x03\x04", "zip"),
    (b"\x1f\x8b", "gz"),
    (b"BZh", "bz2"),
    (b"7z\xbc\xaf\x27\x1c", "7z"),
    (b"Rar!\x1a\x07", "rar"),
    (b"\xfd7zXZ\x00", "xz"),
    (b"\x28\xb5\x2f\xfd", "zst"),
    (b"version https://git-lfs.github.com/spec/", "lfs"),
    (b"Kaydara FBX Binary", "fbx"),
    (b"BLENDER", "blend"),
    (b"ISO-10303-21;", "step"),
    (b"PXR-USDC", "usdc"),
    (b"#usda ", "usda"),
    (b"#VRML", "vrml"),
    (b"DRACO", "drc"),
    (b"%PDF-", "pdf"),
    (b"\x89PNG\r\n\x1a\n", "png"),
    (b"\xff\xd8\xff", "jpg"),
    (b"GIF8", "gif"),
)
_TEXTS = (
    (re.compile(rb"<!doctype html|<html[\s>]", re.IGNORECASE), "html"),
    (re.compile(rb"<\?xml[^>]*>\s*(<!--.*?-->\s*)*<(\w+:)?COLLADA\b", re.DOTALL), "dae"),
    (re.compile(rb"<\?xml[^>]*>\s*(<!DOCTYPE X3D[^>]*>\s*)?<X3D\b"), "x3d"),
    (re.compile(rb"<\?xml[^>]*>\s*<Error>"), "html"),
    (re.compile(rb"<\?xml[^>]*>\s*<!DOCTYPE html", re.IGNORECASE), "html"),
    (re.compile(rb"solid\b[^\n\r]*\s+facet\s+normal\s", re.IGNORECASE), "stl"),
    (
        re.compile(rb'\{\s*"(asset|accessors|animations|buffers|bufferViews|extensionsUsed|scenes?)"\s*:'),
        "gltf",
    ),
    (re.compile(rb"(ST)?C?N?4?n?OFF( BINARY)?\s"), "off"),
)


def kind_of(path: Path) -> str | None:
    """The kind of a file, as the suffix of its format (or `html`, `lfs`); None where its first bytes do not tell.

    STL in binary is told by its length, which its count fits; OBJ is never told.
    """
    with path.open("rb") as file:
        head = file.read(HEAD)
    count = int.from_bytes(head[80:84], "little")
    if count and path.stat().st_size == 84 + 50 * count:
        return "stl"
    if head[257:262] == b"ustar":
        return "tar"
    for beginning, kind in _BEGINNINGS:
        if head.startswith(beginning):
            return kind
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    return next((kind for pattern, kind in _TEXTS if pattern.match(text)), None)
