"""Loading meshes: formats, scenes, welding, and one plain sentence for everything that is no mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from trimesh import creation

from resfit.errors import InputError
from resfit.shape.load import load_mesh


def soup(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh with three vertices of its own for each face, as STL stores it."""
    return trimesh.Trimesh(
        mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size).reshape(-1, 3), process=False
    )


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "off", "glb", "3mf"])
def test_formats_are_read_and_welded(tmp_path: Path, suffix: str) -> None:
    if suffix == "3mf":
        pytest.importorskip("lxml")
    path = tmp_path / f"box.{suffix}"
    soup(creation.box()).export(path)
    mesh = load_mesh(path)
    assert (len(mesh.vertices), len(mesh.faces)) == (8, 12)
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume == pytest.approx(1.0)
    assert len(mesh.sha256) == 64


@pytest.mark.parametrize("scale", [1e-7, 1.0, 1e5])
@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_welding_is_relative_to_the_size(scale: float, offset: float) -> None:
    ball = creation.icosphere(subdivisions=2)
    mesh = soup(ball)
    mesh.vertices = mesh.vertices * scale + offset * scale
    loaded = load_mesh(mesh)
    assert (len(loaded.vertices), len(loaded.faces)) == (len(ball.vertices), len(ball.faces))


def test_scene_nodes_keep_transforms_and_names() -> None:
    scene = trimesh.Scene()
    box = creation.box()
    scene.add_geometry(box, node_name="left", geom_name="box")
    moved = trimesh.transformations.translation_matrix((3.0, 0.0, 0.0))
    scene.graph.update(frame_to="right", matrix=moved, geometry="box")
    mirrored = np.diag([1.0, -1.0, 1.0, 1.0]) @ trimesh.transformations.translation_matrix((0.0, 3.0, 0.0))
    scene.graph.update(frame_to="mirrored", matrix=mirrored, geometry="box")
    mesh = load_mesh(scene)
    assert {part.name for part in mesh.parts} == {"left", "right", "mirrored"}
    assert [part.face_count for part in mesh.parts] == [12, 12, 12]
    assert np.ptp(mesh.vertices, axis=0).tolist() == [4.0, 4.0, 1.0]
    for part in mesh.parts:
        faces = mesh.faces[part.first_face : part.first_face + part.face_count]
        assert trimesh.Trimesh(mesh.vertices, faces).volume == pytest.approx(1.0)


def test_quads_become_triangles(tmp_path: Path) -> None:
    path = tmp_path / "quad.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    assert len(load_mesh(path).faces) == 2


@pytest.mark.parametrize("scale", [1e-250, 1e-150, 1e150, 1e300])
def test_extreme_scales_are_read(scale: float) -> None:
    box = creation.box()
    mesh = load_mesh(trimesh.Trimesh(box.vertices * scale, box.faces, process=False))
    assert len(mesh.faces) == 12
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx(scale)


@pytest.mark.parametrize(("scale", "said"), [(1e-300, "too small"), (1.7e308, "too large")])
def test_scales_beyond_floating_point_are_refused(scale: float, said: str) -> None:
    box = creation.box(extents=(2, 2, 2))
    with pytest.raises(InputError, match=said):
        load_mesh(trimesh.Trimesh(box.vertices * scale, box.faces, process=False))


def test_a_mesh_thinner_than_welding_is_refused_for_what_it_is() -> None:
    points = [*np.eye(3), (0, 0, 0), (0, 1e-3, 0), (1e7, 0, 0), (0, 2e-3, 0)]
    with pytest.raises(InputError, match="thinner than a millionth"):
        load_mesh(trimesh.Trimesh(points, [[0, 1, 2], [4, 5, 6]], process=False))


def test_useless_faces_are_dropped_with_a_note() -> None:
    box = creation.box()
    faces = np.concatenate([box.faces, box.faces[:3, [1, 2, 0]], [[0, 0, 1]]])
    mesh = load_mesh(trimesh.Trimesh(box.vertices, faces, process=False))
    assert len(mesh.faces) == 12
    np.testing.assert_allclose(mesh.vertices[mesh.faces], box.triangles)
    assert "1 face without area was dropped." in mesh.notes
    assert "3 repeated faces were dropped." in mesh.notes


def test_equal_files_have_equal_hashes(tmp_path: Path) -> None:
    for name in ("a.stl", "b.stl"):
        creation.box().export(tmp_path / name)
    creation.box(extents=(1, 1, 2)).export(tmp_path / "c.stl")
    first, second, third = (load_mesh(tmp_path / name).sha256 for name in ("a.stl", "b.stl", "c.stl"))
    assert first == second != third
    assert load_mesh(creation.box()).sha256 == load_mesh(creation.box()).sha256


def write_bad(folder: Path, name: str) -> Path:
    """A path that `load_mesh` has to refuse."""
    path = folder / name
    if name == "folder.stl":
        path.mkdir()
    elif name == "empty.stl":
        path.touch()
    elif name in {"text.obj", "text.stl", "text.ply", "text.glb", "text.xyzzy", "nosuffix"}:
        path.write_text("These are some words,\nnot a mesh.\n")
    elif name == "nofaces.obj":
        path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\n")
    elif name == "cloud.ply":
        trimesh.PointCloud(np.random.default_rng(0).random((50, 3))).export(path)
    elif name == "nan.off":
        path.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\nnan 1 0\n3 0 1 2\n")
    elif name == "line.off":
        path.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n")
    elif name == "point.off":
        path.write_text("OFF\n3 1 0\n1 1 1\n1 1 1\n1 1 1\n3 0 1 2\n")
    elif name == "index.off":
        path.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n")
    return path


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("missing.stl", "no file"),
        ("folder.stl", "is a folder"),
        ("empty.stl", "is empty"),
        ("text.obj", "no faces"),
        ("text.stl", "no faces"),
        ("text.ply", "PLY"),
        ("text.glb", "GLB"),
        ("text.xyzzy", "'.xyzzy'"),
        ("nosuffix", "no suffix"),
        ("nofaces.obj", "no faces"),
        ("cloud.ply", "50 points but no faces"),
        ("nan.off", "not finite"),
        ("line.off", "area"),
        ("point.off", "one place"),
        ("index.off", ""),
    ],
)
def test_bad_input_ends_in_one_sentence(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, said: str
) -> None:
    path = write_bad(tmp_path, name)
    with pytest.raises(InputError) as caught:
        load_mesh(path)
    message = str(caught.value)
    assert said in message
    assert path.name in message or "the mesh" in message
    assert "\n" not in message and message.endswith(".")
    assert capfd.readouterr() == ("", "")


def test_objects_that_are_no_mesh_are_refused() -> None:
    with pytest.raises(InputError, match="int"):
        load_mesh(3)
    with pytest.raises(InputError, match="no faces"):
        load_mesh(trimesh.Scene())
    with pytest.raises(InputError, match="1 of the 1 faces of the mesh has coordinates that are not finite"):
        load_mesh(trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [np.inf, 1, 0]], [[0, 1, 2]], process=False))
