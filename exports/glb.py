"""Binary glTF 2.0: one named node a part, with its colour as material and its parameters in the node's extras.

The root node holds scale and translation to the mesh's frame, each part's node its pose, and vertices stay in the
part's own frame: they are float32 in the file, and would lose their form far from the origin. Coordinates are the
input mesh's own; nothing is turned to glTF's upward y.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from ..assembly.atomic_write import write_bytes
from ..assembly.colors import linear_rgb
from ..assembly.document import FORMAT, VERSION
from ..assembly.primitive import Primitive
from ..assembly.surface import part_surface, union_surface
from .exporter import Exporter
from .mesh import checked_resolution
from .normals import vertex_normals

if TYPE_CHECKING:
    from ..assembly.assembly import Assembly

FLOAT, UNSIGNED_INT, UNSIGNED_SHORT = 5126, 5125, 5123
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963


class GlbBuilder:
    """Collects nodes, meshes and materials of one glTF scene."""

    def __init__(self) -> None:
        self._binary = bytearray()
        self._lists: dict[str, list[dict[str, Any]]] = {
            name: [] for name in ("nodes", "meshes", "materials", "accessors", "bufferViews")
        }

    def add(self, kind: str, entry: dict[str, Any]) -> int:
        """Append `entry` to the list called `kind` and return its index."""
        self._lists[kind].append(entry)
        return len(self._lists[kind]) - 1

    def add_array(self, array: npt.NDArray[Any], target: int, component: int, kind: str, **extra: Any) -> int:
        """Append an array to the binary chunk and return its accessor."""
        # Accessors begin at multiples of four.
        self._binary += bytes(-len(self._binary) % 4)
        view = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": array.nbytes, "target": target}
        self._binary += array.tobytes()
        accessor = {"bufferView": self.add("bufferViews", view), "componentType": component, "type": kind}
        return self.add("accessors", accessor | {"count": len(array), **extra})

    def add_material(self, color: str) -> int:
        """A matt material of colour `#rrggbb`, made once."""
        for index, material in enumerate(self._lists["materials"]):
            if material["name"] == color:
                return index
        surface = {
            "baseColorFactor": [*linear_rgb(color), 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 0.7,
        }
        return self.add("materials", {"name": color, "pbrMetallicRoughness": surface})

    def add_mesh(
        self,
        name: str,
        vertices: npt.NDArray[Any],
        faces: npt.NDArray[Any],
        material: int,
        colors: npt.NDArray[Any] | None = None,
    ) -> int:
        """A mesh of vertices (v, 3), faces (f, 3) and linear colours (v, 3)."""
        normals = vertex_normals(vertices, faces)
        positions = np.ascontiguousarray(vertices, "<f4")
        bounds = {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
        attributes = {
            "POSITION": self.add_array(positions, ARRAY_BUFFER, FLOAT, "VEC3", **bounds),
            "NORMAL": self.add_array(np.ascontiguousarray(normals, "<f4"), ARRAY_BUFFER, FLOAT, "VEC3"),
        }
        if colors is not None:
            attributes["COLOR_0"] = self.add_array(
                np.ascontiguousarray(colors, "<f4"), ARRAY_BUFFER, FLOAT, "VEC3"
            )
        short = len(positions) < 65535
        indices = np.ascontiguousarray(faces.ravel(), "<u2" if short else "<u4")
        width = UNSIGNED_SHORT if short else UNSIGNED_INT
        part = {
            "attributes": attributes,
            "indices": self.add_array(indices, ELEMENT_ARRAY_BUFFER, width, "SCALAR"),
            "material": material,
        }
        return self.add("meshes", {"name": name, "primitives": [part]})

    def finish(self, root: int) -> bytes:
        """The bytes of the file, its scene the node `root`."""
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "resfit"},
            "scene": 0,
            "scenes": [{"nodes": [root]}],
        }
        # Empty lists are not allowed.
        document |= {name: entries for name, entries in self._lists.items() if entries}
        if self._binary:
            document["buffers"] = [{"byteLength": len(self._binary)}]
        text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
        chunks = _chunk(b"JSON", text, b" ")
        if self._binary:
            chunks += _chunk(b"BIN\0", bytes(self._binary), b"\0")
        return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def _chunk(kind: bytes, content: bytes, padding: bytes) -> bytes:
    content += padding * (-len(content) % 4)
    return struct.pack("<I", len(content)) + kind + content


def glb_of_parts(assembly: Assembly, resolution: int, device: str = "auto") -> bytes:
    """A GLB with one node a part; a part without an inside has a node without a mesh.

    Args:
        assembly: what to write.
        resolution: cells along the longest side of each part.
        device: where the field is evaluated.
    """
    builder = GlbBuilder()
    children = []
    for primitive in assembly.primitives:
        node = _part_node(primitive)
        vertices, faces = part_surface(primitive, resolution, device)
        if len(faces):
            material = builder.add_material(primitive.color)
            node["mesh"] = builder.add_mesh(primitive.name, vertices, faces, material)
        children.append(builder.add("nodes", node))
    return builder.finish(
        builder.add("nodes", _root_node(assembly, {"children": children} if children else {}))
    )


def glb_of_union(assembly: Assembly, resolution: int, device: str = "auto") -> bytes:
    """A GLB with the surface of the smooth union as one mesh, coloured by the nearest part.

    Args:
        assembly: what to write.
        resolution: cells along the longest side of the normalised frame.
        device: where the field is evaluated.
    """
    builder = GlbBuilder()
    vertices, faces = union_surface(assembly.primitives, resolution, device)
    content = {}
    if len(faces):
        palette = np.array([linear_rgb(primitive.color) for primitive in assembly.primitives])
        nearest = assembly.primitive_sdf(assembly.transform.to_mesh(vertices), device).argmin(axis=1)
        white = builder.add_material("#ffffff")
        content["mesh"] = builder.add_mesh("assembly", vertices, faces, white, palette[nearest])
    return builder.finish(builder.add("nodes", _root_node(assembly, content)))


def _root_node(assembly: Assembly, content: dict[str, Any]) -> dict[str, Any]:
    transform = assembly.transform
    reach = transform.scale + float(np.abs(transform.translation).max())
    if not reach <= float(np.finfo(np.float32).max):
        raise InputError(
            f"cannot write a GLB: coordinates reach {reach:.3g}, more than readers hold; scale it down."
        )
    return {
        "name": "assembly",
        "translation": list(transform.translation),
        "scale": [transform.scale] * 3,
        "extras": {"format": FORMAT, "version": VERSION},
        **content,
    }


def _part_node(primitive: Primitive) -> dict[str, Any]:
    w, x, y, z = primitive.pose.rotation
    return {
        "name": primitive.name,
        "translation": list(primitive.pose.translation),
        "rotation": [x, y, z, w],
        "extras": {
            "family": primitive.family,
            "parameters": dict(primitive.parameters),
            "blend": primitive.blend,
            "color": primitive.color,
        },
    }


def write_glb(
    assembly: Assembly,
    path: Path,
    *,
    merged: bool = False,
    resolution: int | None = None,
    device: str = "auto",
) -> None:
    """Write .glb.

    Args:
        assembly: what to write.
        path: of the file.
        merged: one surface of the smooth union, or one closed surface a part.
        resolution: cells along the longest side, of the whole or of each part; None is what suits.
        device: where the field is evaluated.

    Raises:
        InputError: if the resolution is impossible, coordinates are too large, or the file cannot be written.
    """
    encode = glb_of_union if merged else glb_of_parts
    write_bytes(path, encode(assembly, checked_resolution(resolution, merged), device))


EXPORTER = Exporter((".glb",), write_glb)
