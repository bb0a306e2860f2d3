"""Finding shapes on disk, whatever way they lie there, and choosing some that are unlike each other."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from resfit.errors import InputError
from resfit.eval.batch.datasets import farthest_clouds, find_shapes, select_diverse


def touch(*paths: Path) -> None:
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")


def test_folder_list_and_file(tmp_path: Path) -> None:
    touch(
        tmp_path / "a" / "one.obj",
        tmp_path / "a" / "two.glb",
        tmp_path / "a" / "notes.md",
        tmp_path / "b.stl",
    )
    (tmp_path / "list.txt").write_text("a/two.glb  # again\n\n# nothing\nb.stl\nmissing.ply\n")
    found = find_shapes([tmp_path / "a", tmp_path / "list.txt", tmp_path / "b.stl"])
    # What is named twice is found once; what is missing fails later, alone.
    assert [shape.name for shape in found] == ["one", "two", "b", "missing"]


def test_meshes_deep_in_a_folder(tmp_path: Path) -> None:
    touch(tmp_path / "x" / "y" / "deep.ply")
    assert [shape.name for shape in find_shapes([tmp_path])] == ["deep"]


def test_equal_names_are_told_apart(tmp_path: Path) -> None:
    touch(tmp_path / "cup.obj", tmp_path / "cup.glb", tmp_path / "p" / "Mug.obj", tmp_path / "q" / "mug.obj")
    touch(tmp_path / "p" / "d" / "x y.obj", tmp_path / "q" / "d" / "x y.obj")
    shapes = find_shapes(
        [tmp_path, *sorted(tmp_path.glob("[pq]/*.obj")), *sorted(tmp_path.glob("[pq]/d/*.obj"))]
    )
    names = [shape.name for shape in shapes]
    assert names[:4] == ["cup_glb", "cup_obj", "Mug_obj_p", "mug_obj_q"]
    assert len({name.lower() for name in names}) == 6 and not any(" " in name for name in names)


def test_toys4k(tmp_path: Path) -> None:
    touch(tmp_path / "airplane" / "airplane_000" / "mesh.obj", tmp_path / "apple" / "apple_012" / "mesh.obj")
    for source in (tmp_path, f"toys4k:{tmp_path}"):
        shapes = find_shapes([source])
        assert [(shape.name, shape.category) for shape in shapes] == [
            ("airplane_000", "airplane"),
            ("apple_012", "apple"),
        ]


def test_generated(tmp_path: Path) -> None:
    touch(tmp_path / "p1" / "textured.glb", tmp_path / "p1" / "white.glb", tmp_path / "p2.obj")
    shapes = find_shapes([f"3dgen:{tmp_path}"])
    assert [(shape.name, shape.path.name) for shape in shapes] == [("p2", "p2.obj"), ("p1", "textured.glb")]


def test_abc(tmp_path: Path) -> None:
    name = "00000002_1ffb81a71e5b402e966b9341_trimesh_000.obj"
    touch(tmp_path / "00000002" / name, tmp_path / "00000003" / name.replace("02_", "03_", 1))
    assert [shape.name for shape in find_shapes([tmp_path])] == ["00000002", "00000003"]


def test_partobjaverse_tiny(tmp_path: Path) -> None:
    touch(tmp_path / "PartObjaverse-Tiny_mesh" / "u1.glb", tmp_path / "PartObjaverse-Tiny_mesh" / "u2.glb")
    touch(tmp_path / "PartObjaverse-Tiny_semantic_gt" / "u2.npy")
    path = tmp_path / "PartObjaverse-Tiny_semantic.json"
    path.write_text(json.dumps({"Animals": {"u1": ["leg"]}, "Vehicles": {"u2": ["wheel"]}}))
    first, second = find_shapes([tmp_path])
    assert (first.category, first.labels) == ("Animals", None)
    assert second.category == "Vehicles" and second.labels is not None and second.labels.name == "u2.npy"
    path.write_text("[1]")
    with pytest.raises(InputError, match="categor"):
        find_shapes([f"partobjaverse:{tmp_path}"])


def test_unknown_layout_and_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no layout 'shapenet'"):
        find_shapes([f"shapenet:{tmp_path}"])
    with pytest.raises(InputError, match="no folder"):
        find_shapes([f"abc:{tmp_path / 'nothing'}"])


def test_farthest_clouds_are_the_farthest(rng: np.random.Generator) -> None:
    cloud = rng.normal(size=(50, 3))
    clouds = [cloud + np.array([x, 0, 0]) for x in (0.0, 0.1, 9.0, 5.0, 8.9)]
    assert farthest_clouds(clouds, 3) == [0, 2, 3]
    assert sorted(farthest_clouds(clouds, 99)) == [0, 1, 2, 3, 4]
    assert farthest_clouds(clouds, 0) == []


def test_diverse_shapes_whatever_their_size(tmp_path: Path) -> None:
    meshes = {
        "box": trimesh.creation.box((1, 1, 1)),
        "box_scaled": trimesh.creation.box((7, 7, 7)),
        "rod": trimesh.creation.box((1, 9, 1)),
        "ball": trimesh.creation.icosphere(),
    }
    for name, mesh in meshes.items():
        mesh.export(tmp_path / f"{name}.stl")
    (tmp_path / "broken.stl").write_text("")
    left_out: list[str] = []
    chosen = select_diverse(find_shapes([tmp_path]), 3, lambda shape, reason: left_out.append(shape.name))
    assert [shape.name for shape in chosen] == ["ball", "box", "rod"]
    assert left_out == ["broken"]
