"""glTF files made byte by byte, for tests of the reader."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

CODES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], "f4")
CUBE_FACES = np.array(
    [
        0,
        1,
        3,
        0,
        3,
        2,
        4,
        6,
        7,
        4,
        7,
        5,
        0,
        4,
        5,
        0,
        5,
        1,
        2,
        3,
        7,
        2,
        7,
        6,
        0,
        2,
        6,
        0,
        6,
        4,
        1,
        5,
        7,
        1,
        7,
        3,
    ],
    "u2",
)
"""Corners of the 12 triangles of the unit cube."""


class GltfFile:
    """A glTF document and its one buffer."""

    def __init__(self, **fields: Any) -> None:
        self.data = bytearray()
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "bufferViews": [],
            "accessors": [],
            "meshes": [],
            "nodes": [],
            **fields,
        }

    def view(self, data: bytes, **fields: Any) -> int:
        """Add a bufferView; its index."""
        self.data += bytes(-len(self.data) % 4)
        entry = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **fields}
        self.json["bufferViews"].append(entry)
        self.data += data
        return len(self.json["bufferViews"]) - 1

    def accessor(self, array: Any, **fields: Any) -> int:
        """Add an accessor with a view of its own; its index."""
        array = np.atleast_1d(array)
        width = array.shape[1] if array.ndim == 2 else 1
        entry = {
            "bufferView": self.view(array.tobytes()),
            "componentType": CODES[array.dtype.str[1:]],
            "count": len(array),
            "type": KINDS[width],
        }
        return self.bare_accessor(**{**entry, **fields})

    def bare_accessor(self, **fields: Any) -> int:
        """Add an accessor as it is given; its index."""
        self.json["accessors"].append(fields)
        return len(self.json["accessors"]) - 1

    def mesh(self, positions: Any = CUBE, corners: Any = CUBE_FACES, **fields: Any) -> int:
        """Add a mesh of one primitive; its index. Arrays become accessors, integers are accessors already."""
        primitive: dict[str, Any] = {
            "attributes": {
                "POSITION": positions if isinstance(positions, int) else self.accessor(np.asarray(positions))
            }
        }
        if corners is not None:
            primitive["indices"] = corners if isinstance(corners, int) else self.accessor(np.asarray(corners))
        for key in ("mode", "targets", "extensions"):
            if key in fields:
                primitive[key] = fields.pop(key)
        primitive["attributes"].update(fields.pop("attributes", {}))
        self.json["meshes"].append({"primitives": [primitive], **fields})
        return len(self.json["meshes"]) - 1

    def node(self, **fields: Any) -> int:
        """Add a node; its index."""
        self.json["nodes"].append(fields)
        return len(self.json["nodes"]) - 1

    def glb(self, **replaced: Any) -> bytes:
        """The bytes of a GLB; `text` replaces the JSON."""
        document = {"buffers": [{"byteLength": len(self.data)}], **self.json}
        text = replaced.get("text", json.dumps(document).encode())
        text += b" " * (-len(text) % 4)
        data = bytes(self.data) + bytes(-len(self.data) % 4)
        return (
            struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(data), len(text), 0x4E4F534A)
            + text
            + struct.pack("<II", len(data), 0x004E4942)
            + data
        )

    def save(self, folder: Path, name: str = "a.glb") -> Path:
        """Write it as GLB."""
        path = folder / name
        path.write_bytes(self.glb())
        return path

    def save_json(self, folder: Path, uri: str, name: str = "a.gltf") -> Path:
        """Write the JSON alone, with a URI for its buffer."""
        path = folder / name
        path.write_text(json.dumps({"buffers": [{"byteLength": len(self.data), "uri": uri}], **self.json}))
        return path


def cube_file(**node: Any) -> GltfFile:
    """A file with one node, which has the unit cube for its mesh."""
    file = GltfFile()
    file.node(mesh=file.mesh(name="cube"), **node)
    return file
