"""Small mesh files made byte by byte, so that each can be made wrong in one place."""

from __future__ import annotations

import base64
import bz2
import copy
import io
import json
import struct
import zipfile
from collections.abc import Callable, Sequence
from importlib.resources import files
from typing import Any

from fuzz.harness import Case

CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
"""A tetrahedron."""

OBJ_FACES = tuple(tuple(corner + 1 for corner in face) for face in FACES)


def tetrahedron(scale: float = 1.0, shift: float = 0.0) -> list[tuple[float, ...]]:
    """Its triangles, nine coordinates each."""
    points = [tuple(scale * value + shift for value in corner) for corner in CORNERS]
    return [(*points[a], *points[b], *points[c]) for a, b, c in FACES]


def stl(triangles: Sequence[Sequence[float]], count: int | None = None) -> bytes:
    """A binary STL file; its header may claim another count."""
    body = b"".join(struct.pack("<12fH", 0, 0, 1, *triangle, 0) for triangle in triangles)
    return b"x" * 80 + struct.pack("<I", len(triangles) if count is None else count) + body


def obj(points: Sequence[Sequence[Any]], faces: Sequence[Sequence[Any]] = OBJ_FACES) -> bytes:
    """An OBJ file; coordinates and indices may be any text."""
    lines = ["v " + " ".join(map(str, point)) for point in points]
    lines += ["f " + " ".join(map(str, face)) for face in faces]
    return ("\n".join(lines) + "\n").encode()


def off(points: Sequence[Sequence[Any]], faces: Sequence[Sequence[Any]] = FACES) -> bytes:
    """An OFF file."""
    lines = ["OFF", f"{len(points)} {len(faces)} 0", *(" ".join(map(str, point)) for point in points)]
    lines += [" ".join(map(str, (len(face), *face))) for face in faces]
    return ("\n".join(lines) + "\n").encode()


PLY_BODY = b"".join(struct.pack("<3f", *corner) for corner in CORNERS) + b"".join(
    struct.pack("<B3i", 3, *face) for face in FACES
)
PLY_TEXT = "".join(f"{a} {b} {c}\n" for a, b, c in CORNERS) + "".join(f"3 {a} {b} {c}\n" for a, b, c in FACES)


def ply(
    body: bytes = PLY_BODY,
    vertices: int = 4,
    faces: int = 4,
    kind: str = "binary_little_endian",
    vertex: str = "property float x\nproperty float y\nproperty float z\n",
    face: str = "property list uchar int vertex_indices\n",
) -> bytes:
    """A PLY file; its header may claim anything."""
    head = (
        f"ply\nformat {kind} 1.0\nelement vertex {vertices}\n{vertex}element face {faces}\n{face}end_header\n"
    )
    return head.encode() + body


GLTF_BINARY = b"".join(struct.pack("<3f", *corner) for corner in CORNERS) + b"".join(
    struct.pack("<3I", *face) for face in FACES
)
GLTF: dict[str, Any] = {
    "asset": {"version": "2.0"},
    "scene": 0,
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0, "name": "n"}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "accessors": [
        {
            "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
            "min": [0.0, 0.0, 0.0], "max": [1.0, 1.0, 1.0],
        },
        {"bufferView": 1, "componentType": 5125, "count": 12, "type": "SCALAR"},
    ],
    "bufferViews": [
        {"buffer": 0, "byteOffset": 0, "byteLength": 48},
        {"buffer": 0, "byteOffset": 48, "byteLength": 48},
    ],
    "buffers": [{"byteLength": 96}],
}  # fmt: skip
"""The document of a tetrahedron."""

Change = Callable[[dict[str, Any]], None]


def put(*path_and_value: Any) -> Change:
    """A change of a document: the last argument goes to the place that the others name."""
    *path, last, value = path_and_value

    def change(document: dict[str, Any]) -> None:
        place: Any = document
        for key in path:
            place = place[key]
        place[last] = value

    return change


def glb(
    change: Change | None = None,
    binary: bytes = GLTF_BINARY,
    text: bytes | None = None,
    chunk: int | None = None,
    length: int | None = None,
    version: int = 2,
) -> bytes:
    """A GLB file; its document may be changed or be `text`, its headers may claim other lengths."""
    document = copy.deepcopy(GLTF)
    if change:
        change(document)
    text = json.dumps(document).encode() if text is None else text
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    body = struct.pack("<I4s", len(text) if chunk is None else chunk, b"JSON") + text
    body += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return b"glTF" + struct.pack("<II", version, 12 + len(body) if length is None else length) + body


def gltf(change: Change | None = None) -> bytes:
    """A glTF file that holds its buffer, as text."""
    document = copy.deepcopy(GLTF)
    document["buffers"][0]["uri"] = (
        "data:application/octet-stream;base64," + base64.b64encode(GLTF_BINARY).decode()
    )
    if change:
        change(document)
    return json.dumps(document).encode()


def zipped(content: bytes, name: str = "a.stl") -> bytes:
    """A ZIP archive of one file."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    return buffer.getvalue()


def good_files() -> list[Case]:
    """Small meshes in every format, to be damaged."""
    import trimesh

    box = trimesh.creation.box((1, 2, 3))
    ball = trimesh.creation.icosphere(subdivisions=1)
    tube = trimesh.creation.annulus(0.5, 1.0, 1.0, sections=12)
    both = trimesh.Scene([box, ball.copy().apply_translation((2, 0, 0))])
    found = []
    for name, shape in (("box", box), ("ball", ball), ("tube", tube)):
        for kind in ("stl", "stl_ascii", "ply", "off", "obj", "glb"):
            content = shape.export(file_type=kind)
            data = content.encode() if isinstance(content, str) else bytes(content)
            found.append(Case(name, data, kind.removesuffix("_ascii")))
        found.append(Case(name, shape.export(file_type="ply", encoding="ascii"), "ply"))
    found.append(Case("scene", both.export(file_type="glb"), "glb"))
    found.append(Case("scene", both.export(file_type="obj").encode(), "obj"))
    found.append(Case("embedded", gltf(), "gltf"))
    found.append(Case("box", zipped(found[0].data), "zip"))
    found.append(Case("box", bz2.compress(found[0].data), "bz2"))
    found.append(Case("cactus", (files("resfit.data") / "potted_cactus.glb").read_bytes(), "glb"))
    return found
