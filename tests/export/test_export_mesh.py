"""GLB, OBJ, PLY and STL: what a reader finds in them, far from the origin too, and nothing half written."""

from __future__ import annotations

import importlib
import json
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import resfit
from resfit.assembly.assembly import Assembly
from resfit.assembly.colors import PALETTE
from resfit.assembly.primitive import Pose, Primitive
from resfit.assembly.transform import Transform
from resfit.errors import InputError
from resfit.exports.by_suffix import export_assembly
from resfit.exports.normals import vertex_normals

SUFFIXES = (".glb", ".obj", ".ply", ".stl")

HALF = (0.5, 0.5, 0.5, 0.5)


def box(name: str, size: tuple[float, float, float], pose: Pose, color: str) -> Primitive:
    return Primitive("cuboid", name, pose, {"size": size}, 0.0, color)


@pytest.fixture
def assembly() -> Assembly:
    """Two boxes and a part without an inside, a million units away."""
    return Assembly(
        (
            box("seat", (0.8, 0.6, 0.1), Pose((0.0, 0.0, 0.2), HALF), PALETTE[0]),
            box("leg 1", (0.1, 0.1, 0.9), Pose((0.05, 0.0, -0.3)), PALETTE[1]),
            box("nothing", (0.0, 0.0, 0.0), Pose(), PALETTE[1]),
        ),
        Transform(0.5, (1e6, -1e6, 2e6)),
    )


def glb_document(path: Path) -> dict[str, Any]:
    """The JSON of a GLB whose lengths are right."""
    content = path.read_bytes()
    magic, version, length = struct.unpack("<4sII", content[:12])
    assert (magic, version, length) == (b"glTF", 2, len(content))
    size, kind = struct.unpack("<I4s", content[12:20])
    assert kind == b"JSON" and size % 4 == 0
    return json.loads(content[20 : 20 + size])


def test_glb_has_one_node_a_part(assembly: Assembly, tmp_path: Path) -> None:
    path = tmp_path / "chair.glb"
    export_assembly(assembly, path, device="cpu")
    document = glb_document(path)
    seat, leg, nothing, root = document["nodes"]
    assert [seat["name"], leg["name"], nothing["name"]] == ["seat", "leg 1", "nothing"]
    assert root["children"] == [0, 1, 2]
    assert root["translation"] == [1e6, -1e6, 2e6] and root["scale"] == [0.5, 0.5, 0.5]
    assert "mesh" not in nothing
    assert seat["extras"]["parameters"] == {"size": [0.8, 0.6, 0.1]}
    assert seat["extras"]["family"] == "cuboid"
    names = [material["name"] for material in document["materials"]]
    assert names == list(PALETTE[:2])
    # Vertices are local: small numbers, which float32 holds.
    for accessor in document["accessors"]:
        if "min" in accessor:
            assert np.abs([accessor["min"], accessor["max"]]).max() < 1.0


def test_glb_is_where_the_mesh_is(assembly: Assembly, tmp_path: Path) -> None:
    path = tmp_path / "chair.glb"
    export_assembly(assembly, path, device="cpu")
    scene = trimesh.load(path)
    assert isinstance(scene, trimesh.Scene)
    assert len(scene.geometry) == 2
    transform, geometry = scene.graph["seat"]
    mesh = scene.geometry[geometry]
    assert isinstance(mesh, trimesh.Trimesh) and mesh.is_watertight and mesh.volume > 0.0
    matrix = np.asarray(transform)
    np.testing.assert_allclose(matrix[:3, 3], [1e6, -1e6, 2e6 + 0.1], atol=1e-6)
    vertices = mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    distance = assembly.primitive_sdf(vertices, device="cpu")[:, 0]
    assert np.abs(distance).max() < 0.5 * 0.8 / 32


def test_obj_groups_parts(assembly: Assembly, tmp_path: Path) -> None:
    path = tmp_path / "chair.obj"
    export_assembly(assembly, path, resolution=16, device="cpu")
    lines = path.read_text().splitlines()
    assert [line for line in lines if line.startswith("o ")] == ["o seat", "o leg 1", "o nothing"]
    corners = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], np.float64)
    indices = np.array([line.split()[1:] for line in lines if line.startswith("f ")], np.int64)
    assert indices.min() == 1 and indices.max() == len(corners)
    assert np.ptp(corners[:, 0]) == pytest.approx(0.5 * 0.15, abs=0.002)
    assert np.abs(assembly.sdf(corners, device="cpu")).max() < 0.03


@pytest.mark.parametrize("suffix", [".ply", ".stl"])
def test_ply_and_stl_of_parts(assembly: Assembly, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"chair{suffix.upper()}"
    near = Assembly(assembly.primitives)
    export_assembly(near, path, merged=False, resolution=24, device="cpu")
    mesh = trimesh.load_mesh(path)
    assert isinstance(mesh, trimesh.Trimesh)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.8 * 0.6 * 0.1 + 0.1 * 0.1 * 0.9, rel=0.1)
    if suffix == ".ply":
        colors = {tuple(color) for color in np.asarray(mesh.visual.vertex_colors)[:, :3].tolist()}  # type: ignore[union-attr]
        assert colors == {(0x44, 0x77, 0xAA), (0xEE, 0x66, 0x77)}


def test_ply_keeps_its_form_far_away(assembly: Assembly, tmp_path: Path) -> None:
    path = tmp_path / "far.ply"
    export_assembly(assembly, path, merged=False, resolution=16, device="cpu")
    vertices = np.asarray(trimesh.load_mesh(path, process=False).vertices)
    assert np.abs(assembly.primitive_sdf(vertices, device="cpu")).min(axis=1).max() < 0.03


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_merged_is_one_surface(assembly: Assembly, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"union{suffix}"
    near = Assembly(assembly.primitives[:2], Transform(2.0))
    export_assembly(near, path, merged=True, resolution=48, device="cpu")
    mesh = trimesh.load(path, force="mesh")
    assert isinstance(mesh, trimesh.Trimesh)
    assert np.abs(near.sdf(mesh.vertices, device="cpu")).max() < 2.0 * 2.0 / 48
    assert mesh.body_count == 1


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("merged", [True, False])
def test_empty_assemblies(suffix: str, merged: bool, tmp_path: Path) -> None:
    path = tmp_path / f"empty{suffix}"
    if suffix == ".glb":
        # It has nodes, if there are any, even without a surface.
        export_assembly(Assembly(), path, merged=merged)
        assert path.stat().st_size > 0
        return
    with pytest.raises(InputError, match="the file would be empty"):
        export_assembly(Assembly(), path, merged=merged)
    assert not path.exists()


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl"])
@pytest.mark.parametrize(
    "transform",
    [
        Transform(1.7e308),
        Transform(1.0, (1.7e308, -1.7e308, 0.0)),
        Transform(1e-38, (1e300, 0.0, 0.0)),
        Transform(5e-324),
    ],
)
def test_numbers_that_no_format_holds(
    transform: Transform, suffix: str, assembly: Assembly, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=r"more than the format holds; scale it down\.$|cannot hold a shape"):
        export_assembly(replace(assembly, transform=transform), tmp_path / f"a{suffix}", resolution=8)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("scale", [1e-300, 1e39, 1e300])
def test_stl_holds_less_than_the_others(scale: float, assembly: Assembly, tmp_path: Path) -> None:
    large = replace(assembly, transform=Transform(scale))
    with pytest.raises(InputError, match="cannot write"):
        export_assembly(large, tmp_path / "a.stl", resolution=8)
    for suffix in (".obj", ".ply"):
        export_assembly(large, tmp_path / f"a{suffix}", resolution=8)
    vertices = np.array(
        [line.split()[1:4] for line in (tmp_path / "a.obj").read_text().splitlines() if line[:2] == "v "],
        float,
    )
    assert np.isfinite(vertices).all() and 0.5 * scale < np.ptp(vertices, axis=0).max() < 50.0 * scale


def test_backslashes_do_not_join_lines(assembly: Assembly, tmp_path: Path) -> None:
    names = ["a\\", "a/", "a"][: len(assembly.primitives)]
    names += [part.name for part in assembly.primitives[3:]]
    export_assembly(assembly.renamed(names), tmp_path / "a.obj", resolution=8, device="cpu")
    lines = (tmp_path / "a.obj").read_text().splitlines()
    groups = [line[2:] for line in lines if line.startswith("o ")]
    assert groups[:3] == ["a/-2", "a/", "a"] and len(set(groups)) == len(names)
    assert not any(line.endswith("\\") for line in lines)


def test_same_assembly_same_bytes(assembly: Assembly, tmp_path: Path) -> None:
    for suffix in SUFFIXES:
        first, second = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
        for path in (first, second):
            export_assembly(assembly, path, merged=False, resolution=8, device="cpu")
        assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize("name", ["chair.xyz", "chair", ".glb", "missing/chair.glb"])
def test_places_that_cannot_be_written(name: str, assembly: Assembly, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        export_assembly(assembly, tmp_path / name)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_folders_and_resolutions_are_refused(assembly: Assembly, tmp_path: Path) -> None:
    folder = tmp_path / "folder.glb"
    folder.mkdir()
    with pytest.raises(InputError, match="is a folder"):
        export_assembly(assembly, folder, resolution=8)
    with pytest.raises(InputError, match="resolution"):
        export_assembly(assembly, tmp_path / "a.glb", resolution=10**6)
    assert [entry.name for entry in tmp_path.iterdir()] == ["folder.glb"]


def test_public_name_is_always_callable(assembly: Assembly, tmp_path: Path) -> None:
    # A module of that name would take the place of the function once it is imported.
    resfit.export(assembly, tmp_path / "a.stl", merged=False, resolution=8)
    importlib.import_module("resfit.exports.mesh")
    resfit.export(assembly, tmp_path / "b.stl", merged=False, resolution=8)
    assert (tmp_path / "a.stl").read_bytes() == (tmp_path / "b.stl").read_bytes()


def test_normals_are_those_of_trimesh() -> None:
    mesh = trimesh.creation.annulus(0.3, 0.5, 1.0)
    # A face without an area, and a vertex of no face.
    vertices = np.concatenate([mesh.vertices, [[2.0, 0.0, 0.0]]])
    faces = np.concatenate([mesh.faces, [[0, 0, 1]]])
    expected = trimesh.Trimesh(vertices, faces, process=False).vertex_normals
    np.testing.assert_allclose(vertex_normals(vertices, faces), expected, atol=1e-12)
