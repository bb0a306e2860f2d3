"""The glTF reader: whatever a file may place is placed right, and damaged files end in one sentence."""

from __future__ import annotations

import base64
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_files import CUBE, CUBE_FACES, GltfFile, cube_file
from read_by_trimesh import read_by_trimesh

from resfit.errors import InputError
from resfit.shape.formats import gltf, read_mesh_file
from resfit.shape.formats.mesh_file import MeshFile

INPUTS = Path(__file__).parents[2] / "data" / "field_inputs"
DEMO = Path(__file__).parents[3] / "src" / "resfit" / "data" / "potted_cactus.glb"
HALF = np.sqrt(0.5)


def bounds(file: MeshFile) -> list[list[float]]:
    """Least and greatest coordinates of the faces, to 4 digits."""
    points = np.concatenate([piece.vertices[piece.faces].reshape(-1, 3) for piece in file.pieces])
    return np.round([points.min(axis=0), points.max(axis=0)], 4).tolist()


def volume(file: MeshFile) -> float:
    """Volume that the pieces enclose together, negative where they are inside out."""
    corners = np.concatenate([piece.vertices[piece.faces] for piece in file.pieces])
    return float(np.linalg.det(corners).sum() / 6.0)


@pytest.mark.parametrize(
    ("name", "pieces", "size", "content"),
    [
        ("glb_fan_only.glb", 6, [1, 1, 1], 1.0),
        ("glb_strips.glb", 6, [1, 1, 1], 1.0),
        ("glb_instancing.glb", 4, [7, 1, 1], 4.0),
        ("glb_quantized.glb", 2, [3, 1, 1], 2.0),
        ("glb_sparse.glb", 1, [1, 1, 3], 3.0),
        ("glb_skin.glb", 1, [0.4, 0.4, 2], -0.32),
        ("glb_morph.glb", 1, [1, 1, 4], 4.0),
        ("gltf_percent.gltf", 1, [1, 1, 1], 1.0),
        # Balls of 320 faces at (0, 0, 0), (3, 0, 0) and (0, 4, 0), and a square.
        ("glb_meshopt.glb", 4, [7, 6, 2], 3 * 4.0470),
    ],
)
def test_field_inputs(name: str, pieces: int, size: list[float], content: float) -> None:
    file = read_mesh_file(INPUTS / name)
    low, high = np.array(bounds(file))
    assert len(file.pieces) == pieces
    assert np.abs(high - low - size).max() < 1e-3
    assert volume(file) == pytest.approx(content, rel=2e-3)
    assert file.notes == () and file.unit == "m" and file.reader == "resfit"


def test_names_that_are_no_text_are_replaced() -> None:
    assert [piece.name for piece in read_mesh_file(INPUTS / "glb_name_surrogate.glb").pieces] == ["\ufffd"]


def test_meshes_are_those_of_trimesh() -> None:
    mine, other = gltf.read(DEMO), read_by_trimesh(DEMO)
    for piece, same in zip(mine.pieces, other.pieces, strict=True):
        assert same.name.startswith(piece.name)
        assert np.array_equal(piece.vertices, same.vertices) and np.array_equal(piece.faces, same.faces)


def test_trimesh_is_not_loaded() -> None:
    code = "import sys; from pathlib import Path; from resfit.shape.formats import read_mesh_file as read"
    code += f"; read(Path({str(DEMO)!r})); sys.exit('trimesh' in sys.modules)"
    assert subprocess.run([sys.executable, "-P", "-c", code]).returncode == 0


@pytest.mark.parametrize(
    ("node", "expected"),
    [
        ({}, [[0, 0, 0], [1, 1, 1]]),
        ({"translation": [1, 2, 3], "scale": [2, 3, 4]}, [[1, 2, 3], [3, 5, 7]]),
        (
            {"translation": [1, 0, 0], "rotation": [0, 0, HALF, HALF], "scale": [2, 1, 1]},
            [[0, 0, 0], [1, 2, 1]],
        ),
        ({"rotation": [0, 0, 7, 7]}, [[-1, 0, 0], [0, 1, 1]]),
        ({"rotation": [0, 0, 0, 0]}, [[0, 0, 0], [1, 1, 1]]),
        ({"matrix": [0, 1, 0, 0, -2, 0, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]}, [[3, 6, 7], [5, 7, 8]]),
        ({"scale": [-1, 1, 1]}, [[-1, 0, 0], [0, 1, 1]]),
    ],
)
def test_transforms(tmp_path: Path, node: dict[str, Any], expected: list[list[float]]) -> None:
    file = cube_file(**node)
    file.node(children=[0], scale=[1, 1, -2])
    found = read_mesh_file(file.save(tmp_path))
    expected = [[*expected[0][:2], -2 * expected[1][2]], [*expected[1][:2], -2 * expected[0][2]]]
    assert bounds(found) == expected
    assert volume(found) == pytest.approx(np.prod(np.subtract(expected[1], expected[0])))


@pytest.mark.parametrize("normalised", [False, True])
@pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "u4", "f4"])
@pytest.mark.parametrize("stride", [0, 28])
def test_component_types_and_strides(tmp_path: Path, kind: str, normalised: bool, stride: int) -> None:
    dtype = np.dtype(kind)
    most = 1 if kind == "f4" else np.iinfo(dtype).max
    points = CUBE.astype(dtype) * dtype.type(most)
    file, width = GltfFile(), 3 * dtype.itemsize
    rows = np.full((8, stride or width), 0xAA, np.uint8)
    rows[:, -width:] = points.view(np.uint8)
    index = file.accessor(points, byteOffset=rows.shape[1] - width, normalized=normalised)
    file.json["accessors"][index]["bufferView"] = file.view(
        rows.tobytes(), **({"byteStride": stride} if stride else {})
    )
    file.node(mesh=file.mesh(index))
    side = 1 if normalised else most
    assert volume(read_mesh_file(file.save(tmp_path))) == pytest.approx(float(side) ** 3)


@pytest.mark.parametrize("kind", ["u1", "u2", "u4", None])
def test_modes(tmp_path: Path, kind: str | None) -> None:
    file = GltfFile()
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "f4")
    orders = {mode: [0, 1, 2, 3] for mode in range(7)} | {4: [0, 1, 2, 0, 2, 3], 5: [0, 1, 3, 2]}
    for mode, order in orders.items():
        corners = None if kind is None else np.array(order, kind)
        positions = square[order] if kind is None else square
        file.node(mesh=file.mesh(positions, corners, mode=mode), translation=[0, 0, mode])
    found = read_mesh_file(file.save(tmp_path))
    assert (found.points, found.lines) == (4, 2 + 4 + 3)
    assert [len(piece.faces) for piece in found.pieces] == [2, 2, 2]
    for piece in found.pieces:
        a, b, c = piece.vertices[piece.faces].transpose(1, 0, 2)
        assert np.allclose(np.cross(b - a, c - a), [0, 0, 1])


def test_strips_are_joined_by_triangles_that_are_none(tmp_path: Path) -> None:
    file = GltfFile()
    corners = np.array([0, 1, 2, 3, 3, 4, 4, 5, 6, 7], "u2")
    file.node(mesh=file.mesh(CUBE, corners, mode=5))
    assert len(read_mesh_file(file.save(tmp_path)).pieces[0].faces) == 4


def test_corners_behind_the_last_triangle_are_said_to_be_left_out(tmp_path: Path) -> None:
    file = GltfFile()
    file.node(mesh=file.mesh(CUBE, CUBE_FACES[:-2]))
    found = read_mesh_file(file.save(tmp_path))
    assert len(found.pieces[0].faces) == 11
    assert found.notes == ("The last triangle of meshes[0].primitives[0] lacks a corner and was left out.",)


def test_names(tmp_path: Path) -> None:
    file = GltfFile()
    named, plain = file.mesh(name="leg"), file.mesh()
    for fields in ({"name": "top"}, {}, {"name": "leg"}, {"name": "a\nb\ud800"}, {"name": 7}):
        file.node(mesh=named, **fields)
    file.node(mesh=plain)
    file.json["meshes"][plain]["primitives"] *= 2
    names = [piece.name for piece in read_mesh_file(file.save(tmp_path)).pieces]
    assert names == ["5", "5", "leg_2", "a\ufffdb\ufffd", "leg_1", "leg", "top"]
    path = tmp_path / "b.glb"
    path.write_bytes(file.glb().replace(b'"top"', b'"t\xf6p"'))
    assert read_mesh_file(path).pieces[-1].name == "t\ufffdp"


@pytest.mark.parametrize(
    ("fields", "count", "said"),
    [
        ({}, 4, ""),
        ({"scenes": []}, 4, ""),
        ({"scenes": [{}]}, 4, ""),
        (
            {"scenes": [{"nodes": [0]}, {"nodes": [1, 2]}]},
            1,
            "3 nodes with meshes outside the default scene were left out.",
        ),
        (
            {"scenes": [{"nodes": [0]}, {"nodes": [1, 2]}], "scene": 1},
            3,
            "1 node with a mesh outside the default scene was left out.",
        ),
    ],
)
def test_scenes(tmp_path: Path, fields: dict[str, Any], count: int, said: str) -> None:
    file = GltfFile(**fields)
    mesh = file.mesh()
    for node in ({}, {}, {"children": [3]}, {"translation": [3, 0, 0]}):
        file.node(mesh=mesh, **node)
    found = read_mesh_file(file.save(tmp_path))
    assert len(found.pieces) == count
    assert said in " ".join(found.notes) and bool(found.notes) == bool(said)


def test_meshes_of_a_file_without_nodes_are_read(tmp_path: Path) -> None:
    file = GltfFile()
    file.mesh(name="a")
    file.mesh(CUBE + 2, name="b")
    assert [piece.name for piece in read_mesh_file(file.save(tmp_path)).pieces] == ["a", "b"]
    file.node(mesh=1)
    found = read_mesh_file(file.save(tmp_path))
    assert [piece.name for piece in found.pieces] == ["b"] and found.notes == (
        "1 mesh without a node was left out.",
    )


def test_few_of_many_shared_vertices(tmp_path: Path) -> None:
    file = GltfFile()
    points = file.accessor(np.concatenate([CUBE + k for k in range(200)]).astype("f4"))
    for k in range(200):
        file.node(mesh=file.mesh(points, (CUBE_FACES + 8 * k).astype("u4")))
    found = read_mesh_file(file.save(tmp_path))
    assert {len(piece.vertices) for piece in found.pieces} == {8}
    assert bounds(found) == [[0, 0, 0], [200, 200, 200]] and volume(found) == pytest.approx(200)
    file.mesh(points, np.array([0, 1, 1600], "u2"))
    file.node(mesh=200)
    with pytest.raises(InputError, match="names a vertex that is not there"):
        read_mesh_file(file.save(tmp_path))


def test_sparse_accessors_without_a_view(tmp_path: Path) -> None:
    file = GltfFile()
    places, values = file.view(np.arange(1, 8, dtype="u1").tobytes()), file.view(CUBE[1:].tobytes())
    sparse = {
        "count": 7,
        "indices": {"bufferView": places, "componentType": 5121},
        "values": {"bufferView": values},
    }
    file.node(mesh=file.mesh(file.bare_accessor(componentType=5126, count=8, type="VEC3", sparse=sparse)))
    assert volume(read_mesh_file(file.save(tmp_path))) == pytest.approx(1)
    sparse["indices"]["componentType"] = 5123
    sparse["count"] = 3
    with pytest.raises(InputError, match=r"accessors\[0\].sparse replaces element 1541 of 8"):
        read_mesh_file(file.save(tmp_path))


def test_morph_targets(tmp_path: Path) -> None:
    file = GltfFile()
    far = file.accessor(np.where(CUBE[:, 2:] > 0, [[0, 0, 2]], 0).astype("f4"))
    targets = [{"NORMAL": 0}, {"POSITION": far}]
    mesh = file.mesh(targets=targets, weights=[1, 0.5])
    for fields in ({}, {"weights": [0, 0]}, {"weights": [0, -1]}):
        file.node(mesh=mesh, **fields)
    found = read_mesh_file(file.save(tmp_path))
    assert [np.ptp(piece.vertices[:, 2]) for piece in found.pieces] == [1, 1, 2]
    file.json["nodes"][1]["weights"] = [1]
    with pytest.raises(
        InputError, match=r"nodes\[1\].weights is a list of 1 where a list of 2 finite numbers"
    ):
        read_mesh_file(file.save(tmp_path))


def test_instances_turn_and_scale(tmp_path: Path) -> None:
    file = GltfFile()
    turns = file.accessor(np.array([[0, 0, 0, 127], [0, 0, 90, 90]], "i1"), normalized=True)
    scales = file.accessor(np.array([[1, 1, 1], [-2, 1, 1]], "f4"))
    attributes = {"ROTATION": turns, "SCALE": scales}
    extensions = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    file.node(mesh=file.mesh(), translation=[0, 0, 5], extensions=extensions)
    found = read_mesh_file(file.save(tmp_path))
    assert bounds(found) == [[-1, -2, 5], [1, 1, 6]] and volume(found) == pytest.approx(3)
    attributes["TRANSLATION"] = file.accessor(np.zeros((3, 3), "f4"))
    with pytest.raises(InputError, match="differ in number"):
        read_mesh_file(file.save(tmp_path))


def skinned(joints: Any, weights: Any) -> GltfFile:
    """The cube with two joints, the second mirrored; its node is far away, which must not matter."""
    file = GltfFile()
    binds = np.tile(np.eye(4, dtype="f4"), (2, 1, 1))
    binds[1, 3, 0] = -1.0
    file.json["skins"] = [{"joints": [1, 2], "inverseBindMatrices": file.accessor(binds.reshape(2, 16))}]
    attributes = {
        "JOINTS_0": file.accessor(np.array(joints)),
        "WEIGHTS_0": file.accessor(np.array(weights, "f4")),
    }
    file.node(mesh=file.mesh(attributes=attributes), skin=0, translation=[100, 0, 0])
    file.node(children=[2])
    file.node(translation=[0, 4, 0], scale=[-1, 1, 1])
    return file


def test_skins(tmp_path: Path) -> None:
    found = read_mesh_file(
        skinned(np.tile([1, 9, 0, 0], (8, 1)).astype("u1"), [[1, 0, 0, 0]] * 8).save(tmp_path)
    )
    assert bounds(found) == [[0, 4, 0], [1, 5, 1]] and volume(found) == pytest.approx(1)
    found = read_mesh_file(
        skinned(np.tile([0, 1, 0, 0], (8, 1)).astype("u2"), [[2, 2, 0, 0]] * 8).save(tmp_path)
    )
    assert bounds(found) == [[0.5, 2, 0], [0.5, 3, 1]]
    found = read_mesh_file(skinned(np.zeros((8, 4), "u1"), np.zeros((8, 4))).save(tmp_path))
    assert bounds(found) == [[0, 0, 0], [1, 1, 1]]
    with pytest.raises(InputError, match="names a joint that is not there"):
        read_mesh_file(skinned(np.full((8, 4), 2, "u1"), np.ones((8, 4))).save(tmp_path))
    file = skinned(np.zeros((8, 4), "u1"), np.ones((8, 4)))
    del file.json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"]
    found = read_mesh_file(file.save(tmp_path))
    assert bounds(found) == [[100, 0, 0], [101, 1, 1]]
    assert found.notes == ("'0' has a skin but no joints, and was placed by its node.",)


def test_stated_bounds_are_compared_with_the_points(tmp_path: Path) -> None:
    file = GltfFile()
    for low, high in (([0, 0, 0], [1, 1, 1.001]), ([0, 0, 0], [1, 1, 4]), ([0, 0, 0], ["1", 1, 1])):
        file.node(mesh=file.mesh(file.accessor(CUBE, min=low, max=high), name=str(high[2])))
    for most in (127, 1):
        stated = {"min": [0, 0, 0], "max": [most] * 3}
        file.node(mesh=file.mesh(file.accessor((CUBE * 127).astype("i1"), normalized=True, **stated)))
    assert sorted(read_mesh_file(file.save(tmp_path)).notes) == [
        "The bounds that the file states for '1' differ from its points.",
        "The bounds that the file states for '4' differ from its points.",
    ]


@pytest.mark.parametrize(
    ("uri", "beside"),
    [
        ("a.bin", "a.bin"),
        ("sub/my%20%C3%A4.bin", "sub/my ä.bin"),
        ("100%25.bin", "100%.bin"),
        ("my%20a.bin", "my%20a.bin"),
        ("sub/../a.bin", "a.bin"),
    ],
)
def test_uris(tmp_path: Path, uri: str, beside: str) -> None:
    file = cube_file()
    (tmp_path / "sub").mkdir()
    (tmp_path / beside).write_bytes(file.data)
    assert volume(read_mesh_file(file.save_json(tmp_path, uri))) == pytest.approx(1)


@pytest.mark.parametrize("head", ["data:application/octet-stream;base64,", "DATA:;base64,"])
def test_data_uris(tmp_path: Path, head: str) -> None:
    file = cube_file()
    coded = base64.b64encode(file.data).decode().rstrip("=")
    assert volume(read_mesh_file(file.save_json(tmp_path, head + coded))) == pytest.approx(1)
    escaped = "".join(f"%{byte:02x}" for byte in file.data)
    assert volume(read_mesh_file(file.save_json(tmp_path, "data:," + escaped))) == pytest.approx(1)


def draco_file(points: Any, corners: Any, **fields: Any) -> GltfFile:
    """A file of one mesh whose accessors have no data but that of Draco."""
    draco = pytest.importorskip("DracoPy", reason="DracoPy (extra gltf) is not installed")
    file = GltfFile(extensionsRequired=["KHR_draco_mesh_compression"])
    packed = file.view(draco.encode(points, corners.reshape(-1, 3), quantization_bits=14, **fields))
    extension = {"bufferView": packed, "attributes": {"POSITION": 0}}
    position = file.bare_accessor(componentType=5126, count=8, type="VEC3", min=[0, 0, 0], max=[1, 1, 1])
    indices = file.bare_accessor(componentType=5123, count=36, type="SCALAR")
    file.node(mesh=file.mesh(position, indices, extensions={"KHR_draco_mesh_compression": extension}))
    return file


def test_draco(tmp_path: Path) -> None:
    found = read_mesh_file(draco_file(CUBE, CUBE_FACES).save(tmp_path))
    assert bounds(found) == [[0, 0, 0], [1, 1, 1]] and volume(found) == pytest.approx(1)
    assert found.notes == ()


def test_draco_joints(tmp_path: Path) -> None:
    generic = {5: np.tile([1, 0, 0, 0], (8, 1)).astype("u1"), 6: np.tile([1, 0, 0, 0], (8, 1)).astype("f4")}
    file = draco_file(CUBE, CUBE_FACES, generic_attributes=generic)
    primitive = file.json["meshes"][0]["primitives"][0]
    primitive["extensions"]["KHR_draco_mesh_compression"]["attributes"] = {
        "JOINTS_0": 5,
        "WEIGHTS_0": 6,
        "POSITION": 7,
    }
    for name, code in (("JOINTS_0", 5121), ("WEIGHTS_0", 5126)):
        primitive["attributes"][name] = file.bare_accessor(componentType=code, count=8, type="VEC4")
    file.json["nodes"][0]["skin"] = 0
    file.json["skins"] = [{"joints": [0, 1]}]
    file.node(translation=[7, 0, 0])
    assert bounds(read_mesh_file(file.save(tmp_path))) == [[7, 0, 0], [8, 1, 1]]


def test_draco_that_has_uncompressed_data_too_needs_no_decoder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    file = cube_file()
    extension = {"bufferView": 0, "attributes": {"POSITION": 0}}
    file.json["meshes"][0]["primitives"][0]["extensions"] = {"KHR_draco_mesh_compression": extension}
    assert volume(read_mesh_file(file.save(tmp_path))) == pytest.approx(1)
    with pytest.raises(
        InputError, match=r"uses Draco compression; call .* -m pip install 'DracoPy>=2' first, or export it"
    ):
        read_mesh_file(INPUTS / "glb_draco_mixed.glb")


def test_draco_data_that_is_none(tmp_path: Path) -> None:
    pytest.importorskip("DracoPy", reason="DracoPy (extra gltf) is not installed")
    with pytest.raises(InputError, match=r"the Draco data of '.*glb_draco_mixed.glb' cannot be decoded"):
        read_mesh_file(INPUTS / "glb_draco_mixed.glb")
