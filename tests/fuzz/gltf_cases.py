"""Hostile glTF files: lengths, counts and indices that lie, graphs that are no trees, features that are not known."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterator
from typing import Any

from fuzz.harness import Case
from fuzz.samples import GLTF, GLTF_BINARY, Change, glb, gltf, put

COUNTS = (
    -1, 0, 1, 2, 5, 1000, 10**6, 3 * 10**8, 10**10, 2**62, 2**63, 2**64, 10**40, 1.5, "4", None, True, [4], {},
)  # fmt: skip

URIS = (
    "../../etc/passwd", "/etc/passwd", "file:///etc/passwd", "http://127.0.0.1:9/x.bin", "https://127.0.0.1:9/x", "",
    ".", "..", "/dev/zero", "/proc/self/environ", "nul\0byte", "a" * 5000, "~/.bashrc", "%2e%2e/%2e%2e/etc/passwd",
    "..\\..\\etc\\passwd", "data:;base64,!!!!", "data:;base64,", "data:,hello", "missing.bin", None, 5, ["x"],
)  # fmt: skip

PRIMITIVE: dict[str, Any] = GLTF["meshes"][0]["primitives"][0]


def without(*path: Any) -> Change:
    """A change that removes a value."""
    *holders, last = path

    def change(document: dict[str, Any]) -> None:
        place: Any = document
        for key in holders:
            place = place[key]
        del place[last]

    return change


def bare(accessor: int, count: Any) -> Change:
    """An accessor without a view, which stands for as many zeros as it claims."""

    def change(document: dict[str, Any]) -> None:
        without("accessors", accessor, "bufferView")(document)
        put("accessors", accessor, "count", count)(document)

    return change


def length_cases() -> Iterator[Case]:
    """Lengths, counts, offsets and types."""
    for length in (0, 1, 3, 0x7FFFFFFF, 0xFFFFFFFF):
        yield Case(f"chunk {length}", glb(chunk=length), "glb")
        yield Case(f"length {length}", glb(length=length), "glb")
        yield Case(f"version {length}", glb(version=length), "glb")
    for which in (0, 1):
        for count in COUNTS:
            yield Case(f"count {which} {count}", glb(put("accessors", which, "count", count)), "glb")
            yield Case(f"bare {which} {count}", glb(bare(which, count)), "glb")
        for value in (-1, 2, 99, None, "0", 1.5, 2**64):
            for place, key in (
                ("accessors", "bufferView"), ("bufferViews", "buffer"), ("bufferViews", "byteOffset"),
                ("bufferViews", "byteLength"), ("accessors", "byteOffset"), ("accessors", "componentType"),
            ):  # fmt: skip
                yield Case(f"{key} {place} {which} {value}", glb(put(place, which, key, value)), "glb")
        for value in (-12, 0, 1, 12, 13, 2**31, 2**62):
            yield Case(f"stride {which} {value}", glb(put("bufferViews", which, "byteStride", value)), "glb")
        for kind in ("SCALAR", "VEC2", "VEC4", "MAT4", "none", None):
            yield Case(f"type {which} {kind}", glb(put("accessors", which, "type", kind)), "glb")
        for component in (5120, 5123):
            yield Case(
                f"component {which} {component}",
                glb(put("accessors", which, "componentType", component)),
                "glb",
            )
    for index in (4, 255, 65535, 2**31, 2**32 - 1):
        yield Case(f"corner {index}", glb(binary=GLTF_BINARY[:-4] + struct.pack("<I", index)), "glb")
    for name, bits in (("nan", b"\0\0\xc0\x7f"), ("inf", b"\0\0\x80\x7f"), ("max", b"\xff\xff\x7f\x7f")):
        yield Case(f"vertex {name}", glb(binary=bits + GLTF_BINARY[4:]), "glb")


def index_cases() -> Iterator[Case]:
    """References to what is not there, and values of another kind."""
    for mode in (-1, 0, 1, 2, 3, 4, 5, 6, 7, 99, None, "4"):
        yield Case(f"mode {mode}", glb(put("meshes", 0, "primitives", 0, "mode", mode)), "glb")
    for value in (-1, 1, 7, None, "POSITION", 2**64):
        primitive = ("meshes", 0, "primitives", 0)
        yield Case(f"position {value}", glb(put(*primitive, "attributes", "POSITION", value)), "glb")
        yield Case(f"indices {value}", glb(put(*primitive, "indices", value)), "glb")
        yield Case(f"mesh {value}", glb(put("nodes", 0, "mesh", value)), "glb")
        yield Case(f"root {value}", glb(put("scenes", 0, "nodes", [value])), "glb")
        yield Case(f"scene {value}", glb(put("scene", value)), "glb")
        yield Case(f"child {value}", glb(put("nodes", 0, "children", [value])), "glb")
    for key in GLTF:
        for value in (None, [], {}, "x", 7, [None], [[]], [{}]):
            yield Case(f"{key} is {json.dumps(value)}", glb(put(key, value)), "glb")
        yield Case(f"no {key}", glb(without(key)), "glb")


def node_cases() -> Iterator[Case]:
    """Graphs, transforms, names and features."""
    chain = [*({"children": [i + 1]} for i in range(99999)), {"mesh": 0}]
    flat = [
        {"children": list(range(1, 100000))},
        *({"mesh": 0, "translation": [i, 0, 0]} for i in range(99999)),
    ]
    ladder = [*({"children": [i + 1, i + 1]} for i in range(60)), {"mesh": 0}]
    parents = [
        {"children": [1, 2]},
        {"children": [3]},
        {"children": [3], "translation": [5, 0, 0]},
        {"mesh": 0},
    ]
    graphs = {
        "cycle": [{"mesh": 0, "children": [1]}, {"children": [0]}],
        "own child": [{"mesh": 0, "children": [0]}],
        "cycle elsewhere": [{"mesh": 0}, {"children": [2], "mesh": 0}, {"children": [1], "mesh": 0}],
        "two parents": parents,
        "same child": [{"children": [1] * 1000}, {"mesh": 0}],
        "chain of 100000": chain,
        "flat 100000": flat,
        "empty 100000": [{"mesh": 0, "children": list(range(1, 100000))}, *({} for _ in range(99999))],
        "ladder of 60": ladder,
    }
    for name, nodes in graphs.items():
        yield Case(name, glb(put("nodes", nodes)), "glb")
    yield Case("same root", glb(put("scenes", 0, "nodes", [0, 0, 0])), "glb")
    transforms: dict[str, Any] = {
        "matrix": (
            [math.nan] * 16, [1e308] * 16, [0] * 16, [1, 0, 0], ["a"] * 16,
            [1, 0, 0, 5, 0, 1, 0, 5, 0, 0, 1, 5, 0, 0, 0, 1],
        ),
        "scale": ([0, 0, 0], [1, 1, 0], [-1, 1, 1], [1e300] * 3, [1e-300] * 3),
        "rotation": ([0, 0, 0, 0], [math.nan, 0, 0, 1]),
        "translation": ([1e300, 0, 0], [1]),
        "name": (5, ["a"], None, "world", "", "</script><script>x</script>",
            "../../../../tmp/x\n\r\0\u202e", "n" * 10000, "\ud800"),
        "camera": (0,),
        "skin": (0,),
        "weights": ([1.0], "x"),
        "extras": ({"matrix": "x", "geometry": "y"},),
        "extensions": ({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}, {"EXT_mesh_gpu_instancing": 5}),
    }  # fmt: skip
    for key, values in transforms.items():
        for number, value in enumerate(values):
            yield Case(f"node {key} {number}", glb(put("nodes", 0, key, value)), "glb")


def feature_cases() -> Iterator[Case]:
    """Extensions and attributes, present and odd."""
    primitive = ("meshes", 0, "primitives", 0)
    draco = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    meshopt = {
        "EXT_meshopt_compression": {
            "buffer": 0,
            "byteLength": 48,
            "byteStride": 12,
            "count": 4,
            "mode": "ATTRIBUTES",
        }
    }
    changes = {
        "mesh extras": put("meshes", 0, "extras", {"vertices": [1], "faces": "x", "process": True, "class": "Scene"}),
        "draco": put(*primitive, "extensions", draco),
        "meshopt": put("bufferViews", 0, "extensions", meshopt),
        "extension unknown": put(*primitive, "extensions", {"X_y": 5}),
        "extension required": put("extensionsRequired", ["EXT_nothing_known"]),
        "sparse": put("accessors", 0, "sparse", {"count": 10**9, "indices": {}, "values": {}}),
        "targets": put(*primitive, "targets", [{"POSITION": 9}]),
        "normalized": put("accessors", 0, "normalized", "x"),
        "bounds": put("accessors", 0, "max", [9.0, 9.0, 9.0]),
        "bounds short": put("accessors", 0, "min", [0.0]),
        "bounds nan": put("accessors", 0, "min", [math.nan] * 3),
        "uri in glb": put("buffers", 0, "uri", "../../../../../etc/passwd"),
        "3000 primitives": put("meshes", 0, "primitives", [PRIMITIVE] * 3000),
        "3000 meshes": put("meshes", [{"primitives": [PRIMITIVE]}] * 3000),
        "attributes": put(*primitive, "attributes", {"POSITION": 0, "_x": 1, "NORMAL": 1, "COLOR_0": 1}),
        "image": put("images", [{"uri": "../../etc/passwd"}]),
    }  # fmt: skip
    for name, change in changes.items():
        yield Case(name, glb(change), "glb")


def document_cases() -> Iterator[Case]:
    """Documents that are none, and buffers that lie elsewhere."""
    yield Case("good", glb(), "glb")
    yield Case("good", gltf(), "gltf")
    yield Case("deep json", glb(text=b'{"asset":' + b"[" * 100000 + b"]" * 100000 + b"}"), "glb")
    yield Case("deep json", b'{"asset":' * 50000, "gltf")
    for text in (
        b"[1, 2]",
        b"null",
        b"1" * 5000,
        b'{"asset": {"version": "x.y"}}',
        b'{"asset": {"version": [2]}}',
    ):
        yield Case(f"document {text[:20].decode()}", text, "gltf")
    for uri in URIS:
        yield Case(f"uri {str(uri)[:30]!a}", gltf(put("buffers", 0, "uri", uri)), "gltf")


def gltf_cases() -> Iterator[Case]:
    """All of the above."""
    for source in (length_cases, index_cases, node_cases, feature_cases, document_cases):
        for case in source():
            yield Case(f"gltf {case.name}", case.data, case.suffix)
