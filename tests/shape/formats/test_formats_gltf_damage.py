"""Damaged and hostile glTF files: each ends in one sentence, and none takes more memory than its bytes justify."""

from __future__ import annotations

import base64
import copy
import json
import os
import tracemalloc
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_files import GltfFile, cube_file

from resfit.errors import InputError
from resfit.shape.formats import gltf, read_mesh_file

INPUTS = Path(__file__).parents[2] / "data" / "field_inputs"
VALUES = [
    None,
    True,
    -1,
    0,
    1,
    2,
    3.5,
    255,
    2**31,
    2**63,
    1e300,
    float("nan"),
    "",
    "x",
    [],
    [0],
    [1.0] * 16,
    {},
]
"""What fields are replaced by."""


@pytest.mark.parametrize(
    ("uri", "said"),
    [
        ("missing.bin", "needs 'missing.bin' beside it, which is not there"),
        ("../secret", "which is not in its folder"),
        ("..%2fsecret", "which is not in its folder"),
        ("link", "which is not in its folder"),
        ("/etc/passwd", "which is not in its folder"),
        ("%2Fetc%2Fpasswd", "which is not in its folder"),
        ("C:\\a.bin", "which is not in its folder"),
        ("http://localhost/a.bin", "which is not in its folder"),
        ("file:///etc/passwd", "which is not in its folder"),
        ("pipe", "is no regular file"),
        (".", "is no regular file"),
        ("a\0b\n\ud800", "needs 'a\ufffdb\ufffd\ufffd' beside it"),
        ("short.bin", "is cut short: bufferViews[0] ends at byte 96 of a buffer of 3"),
        ("data:;base64,A", "buffers[0].uri"),
        ("x" * 5000, "cannot be read: File name too long"),
    ],
)
def test_uris_that_are_refused(tmp_path: Path, uri: str, said: str) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "secret").write_bytes(bytes(1000))
    (folder / "link").symlink_to(tmp_path / "secret")
    (folder / "short.bin").write_bytes(b"abc")
    os.mkfifo(folder / "pipe")
    with pytest.raises(InputError) as error:
        read_mesh_file(cube_file().save_json(folder, uri))
    check_sentence(str(error.value))
    assert said in str(error.value)


def check_sentence(message: str) -> None:
    """One sentence that names the file."""
    assert message.isprintable() and message.endswith(".") and len(message) < 6000
    assert "a.gl" in message or ".glb" in message or ".gltf" in message


def test_what_surrounds_the_chunks(tmp_path: Path) -> None:
    whole = cube_file().glb()
    path = tmp_path / "a.glb"
    length = int.from_bytes(whole[12:16], "little")
    own = whole[: 20 + length] + b"\4\0\0\0MINEabcd" + whole[20 + length :]
    for data in (whole + b"trailing bytes", own, whole[:8] + b"\0\0\0\0" + whole[12:]):
        path.write_bytes(data)
        assert len(read_mesh_file(path).pieces[0].faces) == 12
    document = json.loads(whole[20 : 20 + length])
    document["buffers"][0]["uri"] = "data:;base64," + base64.b64encode(cube_file().data).decode()
    path.write_bytes(b"\xef\xbb\xbf" + json.dumps(document).encode())
    assert len(read_mesh_file(path).pieces[0].faces) == 12
    for size in (*range(0, len(whole) - 2, 7), len(whole) - 2):
        path.write_bytes(whole[:size])
        with pytest.raises(InputError) as error:
            read_mesh_file(path)
        check_sentence(str(error.value))


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"glTF\1\0\0\0" + bytes(20), "is a GLB of glTF 1; export it as glTF 2.0"),
        (b'{"asset": {"version": "1.0"}}', "is glTF 1.0, which is not read here"),
        (b'{"meshes": {"a": {}}}', "is glTF 1.0"),
        (b'{"asset": {"version": "2.1", "minVersion": "2.1"}}', "is glTF 2.1"),
        (b'{"asset": {"version": 2}}', "asset.version is 2 where a string belongs"),
        (b"[]", "the JSON is a list of 0 where an object belongs"),
        (b"null", "the JSON is missing where an object belongs"),
        (b"words", "is no GLB file that can be read: it holds no valid JSON"),
        (b"[" * 200000, "holds no valid JSON"),
        (b'{"a": ' + b"9" * 5000 + b"}", "holds no valid JSON"),
        (b"glTF\2\0\0\0\0\0\0\0\0\0\0\0", "does not begin with a JSON chunk"),
        (
            b'{"extensionsRequired": ["KHR_materials_unlit", "ACME_shape\\n"]}',
            "needs the glTF extension 'ACME_shape\ufffd', which is not read here",
        ),
    ],
)
def test_files_that_are_refused(tmp_path: Path, data: bytes, said: str) -> None:
    path = tmp_path / "a.glb"
    path.write_bytes(data)
    with pytest.raises(InputError) as error:
        read_mesh_file(path)
    check_sentence(str(error.value))
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        (("nodes",), 3, "nodes is 3 where a list belongs"),
        (("nodes", 0), "x", 'nodes[0] is "x" where an object belongs'),
        (("nodes", 0, "mesh"), 7, "nodes[0].mesh is 7 where an integer from 0 to 0 belongs"),
        (("nodes", 0, "mesh"), True, "nodes[0].mesh is true"),
        (("nodes", 0, "mesh"), -1, "nodes[0].mesh is -1"),
        (("nodes", 0, "children"), [0], "form no trees, for nodes[0]"),
        (
            ("nodes", 0, "children"),
            [1e3],
            "nodes[0].children is a list of 1 where a list of integers from 0 to 1",
        ),
        (
            ("nodes", 0, "matrix"),
            [1] * 15,
            "nodes[0].matrix is a list of 15 where a list of 16 finite numbers",
        ),
        (
            ("nodes", 0, "matrix"),
            [1] * 16,
            "nodes[0].matrix is a list of 16 where an affine transform belongs",
        ),
        (("nodes", 0, "scale"), [1, float("nan"), 1], "nodes[0].scale"),
        (("nodes", 0, "scale"), [1, 10**400, 1], "nodes[0].scale"),
        (("nodes", 0, "skin"), 0, "nodes[0].skin is 0 where nothing belongs"),
        (("nodes", 1, "children"), [0, 0], "form no trees, for nodes[0]"),
        (("scenes",), [{"nodes": [0]}], "form no trees, for nodes[0]"),
        (("scenes",), [{"nodes": [1, 1]}], "form no trees, for nodes[1]"),
        (("scene",), 0, "scene is 0 where nothing belongs"),
        (("meshes", 0, "primitives"), {}, "meshes[0].primitives is an object where a list belongs"),
        (("meshes", 0, "primitives", 0, "mode"), 7, "mode is 7 where an integer from 0 to 6 belongs"),
        (
            ("meshes", 0, "primitives", 0, "indices"),
            "0",
            'indices is "0" where an integer from 0 to 1 belongs',
        ),
        (("meshes", 0, "primitives", 0, "attributes"), None, "attributes is missing"),
        (("accessors", 0, "type"), "VEC2", 'accessors[0].type is "VEC2" where "VEC3" belongs'),
        (("accessors", 0, "componentType"), 5124, "componentType is 5124 where one of 5120, 5121"),
        (("accessors", 0, "count"), 9, "accessors[0] ends at byte 108 of a bufferView of 96"),
        (("accessors", 0, "count"), 10**18, "accessors[0] ends at byte"),
        (("accessors", 0, "count"), 1e400, "accessors[0].count is Infinity"),
        (("accessors", 0, "byteOffset"), -12, "accessors[0].byteOffset is -12"),
        (("accessors", 0, "normalized"), "yes", "accessors[0].normalized"),
        (("accessors", 1, "componentType"), 5122, "componentType is 5122 where 5121, 5123 or 5125"),
        (("accessors", 0, "bufferView"), 9, "accessors[0].bufferView is 9"),
        (
            ("bufferViews", 0, "byteStride"),
            4,
            "bufferViews[0].byteStride is 4 where an integer from 12 belongs",
        ),
        (("bufferViews", 0, "byteLength"), 2**40, "is cut short: bufferViews[0] ends at byte 1099511627776"),
        (("bufferViews", 0, "buffer"), 1, "bufferViews[0].buffer is 1"),
        (("bufferViews", 0, "buffer"), None, "bufferViews[0].buffer is missing"),
        (("buffers", 0, "uri"), 3, "buffers[0].uri is 3 where a string belongs"),
        (
            ("bufferViews", 0, "extensions"),
            {"EXT_meshopt_compression": {}},
            "EXT_meshopt_compression.buffer is missing",
        ),
    ],
)
def test_fields_that_are_not_valid(tmp_path: Path, place: tuple[Any, ...], value: Any, said: str) -> None:
    file = cube_file()
    file.node(children=[0])
    file.json["buffers"] = [{"byteLength": len(file.data)}]
    change(file.json, place, value)
    with pytest.raises(InputError) as error:
        read_mesh_file(file.save(tmp_path))
    check_sentence(str(error.value))
    assert said in str(error.value)


def change(document: Any, place: tuple[Any, ...], value: Any) -> None:
    for key in place[:-1]:
        document = document[key]
    document[place[-1]] = value


@pytest.mark.parametrize(
    "name", ["glb_bare1_300000000.glb", "instances", "primitives", "sparse", "meshopt", "joints"]
)
def test_claims_are_checked_before_anything_is_made(tmp_path: Path, name: str) -> None:
    file = cube_file()
    many = file.accessor(np.zeros((9000, 3), "f4"))
    if name == "instances":
        extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": many}}}
        file.node(mesh=file.mesh(many, None), extensions=extension)
    elif name == "primitives":
        file.json["meshes"][0]["primitives"] = [{"attributes": {"POSITION": many}}] * 2000
    elif name == "sparse":
        file.json["accessors"][0] |= {"count": 10**9, "sparse": {"count": 0}}
        del file.json["accessors"][0]["bufferView"]
    elif name == "meshopt":
        packed = {"buffer": 0, "byteLength": 96, "byteStride": 4, "count": 10**9, "mode": "ATTRIBUTES"}
        file.json["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": packed}
    elif name == "joints":
        file.json["skins"] = [{"joints": [0] * 9000, "inverseBindMatrices": 0}]
        file.json["nodes"][0]["skin"] = 0
        bare = file.bare_accessor(componentType=5121, count=10**9, type="VEC4")
        file.json["meshes"][0]["primitives"][0]["attributes"] |= {"JOINTS_0": bare, "WEIGHTS_0": bare}
    path = INPUTS / name if name.endswith(".glb") else file.save(tmp_path)
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as error:
            gltf.read(path)
        assert tracemalloc.get_traced_memory()[1] < 500e6
    finally:
        tracemalloc.stop()
    check_sentence(str(error.value))


def test_deep_trees_are_walked_without_recursion(tmp_path: Path) -> None:
    file = GltfFile()
    mesh = file.mesh()
    for number in range(20000):
        file.node(children=[number + 1], translation=[0, 0, 1])
    file.node(mesh=mesh)
    assert read_mesh_file(file.save(tmp_path)).pieces[0].vertices[0].tolist() == [0, 0, 20000]
    file.json["nodes"][-1]["children"] = [5]
    with pytest.raises(InputError, match="form no trees"):
        read_mesh_file(file.save(tmp_path))


def places(value: Any, place: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The keys that lead to each value in a JSON document."""
    pairs = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [found for key, item in pairs for found in [(*place, key), *places(item, (*place, key))]]


@pytest.mark.parametrize("path", sorted(INPUTS.glob("gl*")), ids=lambda path: path.name)
def test_any_damage_ends_in_one_sentence(tmp_path: Path, path: Path, rng: np.random.Generator) -> None:
    whole = path.read_bytes()
    start = 20 if path.suffix == ".glb" else 0
    end = start + int.from_bytes(whole[12:16], "little") if start else len(whole)
    document = json.loads(whole[start:end])
    (tmp_path / "my part.bin").write_bytes(bytes(168))
    (tmp_path / "missing.bin").write_bytes((INPUTS / "my part.bin").read_bytes())
    damaged = tmp_path / path.name
    spots = places(document)
    for _ in range(60):
        changed = copy.deepcopy(document)
        for spot in rng.choice(len(spots), rng.integers(1, 3)):
            with suppress(LookupError, TypeError):
                change(changed, spots[spot], VALUES[rng.integers(len(VALUES))])
        file = GltfFile()
        file.data = bytearray(whole[end + 8 :] if start else b"")
        for place in rng.choice(max(len(file.data), 1), rng.integers(0, 3)):
            file.data[place : place + 1] = rng.bytes(1)
        text = json.dumps(changed).encode()
        damaged.write_bytes(file.glb(text=text) if start else text)
        try:
            gltf.read(damaged)
        except InputError as error:
            check_sentence(str(error))
