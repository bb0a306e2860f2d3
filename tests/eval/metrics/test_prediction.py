"""Whole evaluations: assemblies and parts of other tools, whose scores are known or must be the same."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from gltf_files import GltfFile

import resfit
from resfit.assembly.assembly import Assembly
from resfit.assembly.primitive import Pose, Primitive
from resfit.assembly.transform import Transform
from resfit.errors import InputError
from resfit.eval.metrics.prediction import AssemblyPrediction
from resfit.eval.metrics.prediction_files import PartFile, read_prediction
from resfit.eval.metrics.prediction_parts import PartMesh, PartsPrediction

INPUTS = Path(__file__).parents[2] / "data" / "field_inputs"


def cuboid(name: str, at: tuple[float, float, float], size: tuple[float, float, float], blend: float = 0.0):
    return Primitive("cuboid", name, Pose(at), {"size": size}, blend)


def box_mesh(at: tuple[float, float, float], size: tuple[float, float, float]) -> trimesh.Trimesh:
    return trimesh.creation.box(size).apply_translation(at)


TARGET = box_mesh((100.0, 0.0, 0.0), (18.0, 9.0, 9.0))
"""Half sides 0.9, 0.45, 0.45 in the normalised frame, ten mesh units each."""
FRAME = Transform(10.0, (100.0, 0.0, 0.0))
HALVES = (cuboid("a", (-0.45, 0.0, 0.0), (0.9, 0.9, 0.9)), cuboid("b", (0.3, 0.0, 0.0), (1.2, 0.9, 0.9)))


def test_perfect_prediction() -> None:
    row = resfit.evaluate(Assembly((cuboid("a", (0, 0, 0), (1.8, 0.9, 0.9)),), FRAME), TARGET)
    assert row["iou"] == 1.0
    # Of 60000 points a few lie so close to the surface that rounding decides.
    assert row["bisurf_iou"] > 0.999 and row["bisurf_iou_005"] > 0.999
    assert row["cd"] == pytest.approx(row["cd_floor"], rel=0.2)
    assert row["emd"] < 0.06 and row["surface_max"] < 1e-3
    assert (row["primitive_count"], row["overlap"], row["unoverlap"], row["floats"]) == (1, 0.0, 0.0, 15)
    assert row["closed"] and row["notes"] == [] and row["intra_prim"] is None


def test_assembly_and_its_parts_as_meshes_score_alike(tmp_path: Path) -> None:
    assembly = Assembly(HALVES, FRAME)
    scene = trimesh.Scene()
    for part in HALVES:
        (x, y, z), (a, b, c) = part.pose.translation, part.parameters["size"]
        scene.add_geometry(
            box_mesh((10 * x + 100, 10 * y, 10 * z), (10 * a, 10 * b, 10 * c)), node_name=part.name
        )
    scene.export(tmp_path / "parts.glb")
    assembly.save(tmp_path / "assembly.json")
    TARGET.export(tmp_path / "target.stl")
    whole = resfit.evaluate(tmp_path, tmp_path / "target.stl")
    parts = resfit.evaluate(tmp_path / "parts.glb", tmp_path / "target.stl")
    # The halves share 0.3 of 1.8.
    for row in (whole, parts):
        assert row["overlap"] == pytest.approx(0.3 / 1.8, abs=0.02)
        assert row["iou"] > 0.999 and row["surface_p95"] < 1e-3 and row["primitive_count"] == 2
    assert parts["overlap"] == whole["overlap"]
    for key, tolerance in (("bisurf_iou", 5e-3), ("bisurf_iou_005", 5e-3), ("cd", 0.02), ("emd", 0.01)):
        assert parts[key] == pytest.approx(whole[key], abs=tolerance)
    assert parts["cd_floor"] == whole["cd_floor"]
    assert (whole["floats"], parts["floats"]) == (2 * 11 + 4, 2 * 8 * 3)


def test_assembly_against_its_own_mesh() -> None:
    parts = (HALVES[0], cuboid("b", (0.6, 0.0, 0.3), (1.0, 0.5, 0.3), blend=0.2))
    assembly = Assembly(parts, Transform(3.0, (5.0, -7.0, 2.0)))
    row = resfit.evaluate(assembly, assembly.to_mesh(), emd=False)
    assert row["iou"] > 0.99 and row["bisurf_iou"] > 0.97 and row["surface_p95"] < 0.003
    assert row["unoverlap"] > 0.0 and row["emd"] is None


def test_iou_of_a_box_that_is_too_long() -> None:
    # 115 of 128 layers of cells lie within 0.9 of the middle, and 64 of them in the half.
    row = resfit.evaluate([box_mesh((95.5, 0, 0), (9.0, 9.0, 9.0))], TARGET, emd=False)
    assert row["iou"] == pytest.approx(0.5, abs=0.01)
    # The far end is 0.9 away.
    assert row["surface_max"] == pytest.approx(0.9, abs=0.01)


def test_two_balls_have_the_iou_of_their_volumes() -> None:
    big = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    small = trimesh.creation.icosphere(subdivisions=4, radius=0.8)
    row = resfit.evaluate(small, big, emd=False)
    assert row["iou"] == pytest.approx(0.8**3, abs=0.005)
    # All of either surface is 0.2 * 0.9 from the other: squared, in hundredths, plus what sampling adds.
    assert row["cd"] == pytest.approx(100 * 0.18**2, abs=row["cd_floor"] + 0.02)
    assert row["surface_mean"] == pytest.approx(0.18, abs=1e-3)


def test_only_the_frame_of_an_assembly_differs() -> None:
    near = Assembly(HALVES, FRAME)
    scaled = tuple(
        Primitive(
            part.family,
            part.name,
            Pose(tuple(2.0 * np.add(part.pose.translation, (0.1, 0.0, 0.0)))),
            {"size": tuple(2.0 * np.array(part.parameters["size"]))},
        )
        for part in HALVES
    )
    far = Assembly(scaled, Transform(5.0, (99.0, 0.0, 0.0)))
    rows = [AssemblyPrediction(assembly, FRAME, "cpu").primitives.rows_numpy() for assembly in (near, far)]
    np.testing.assert_allclose(rows[0], rows[1], atol=1e-6)


def test_other_units_are_noticed_and_aligned() -> None:
    small = Assembly(HALVES, Transform(0.01))
    row = resfit.evaluate(small, TARGET, emd=False)
    assert row["iou"] == 0.0 and "different frames or units" in row["notes"][0]
    row = resfit.evaluate(small, TARGET, emd=False, align="bbox")
    assert row["iou"] > 0.97 and "scaled by" in row["notes"][0]
    meshes = [
        mesh.apply_scale(0.1)
        for mesh in (box_mesh((95.5, 0, 0), (9, 9, 9)), box_mesh((103, 0, 0), (12, 9, 9)))
    ]
    assert resfit.evaluate(meshes, TARGET, emd=False, align="bbox")["iou"] > 0.97


def test_empty_assembly_has_no_distances() -> None:
    row = resfit.evaluate(Assembly((), FRAME), TARGET)
    assert (row["iou"], row["bisurf_iou"], row["cd"], row["emd"], row["surface_p95"]) == (
        0.0,
        0.0,
        None,
        None,
        None,
    )
    assert row["cd_floor"] > 0.0 and row["notes"] == []


def test_distances_beyond_all_numbers_are_left_out() -> None:
    size = {
        "size": (1e15, 1e15, 1e15),
        "roundness": 1.0,
        "dilation": 0.02,
        "taper": 0.5,
        "bulge": 0.0,
        "onion": -1.0,
    }
    row = resfit.evaluate(Assembly((Primitive("superfrustum", "a", Pose(), size),), FRAME), TARGET, emd=False)
    json.dumps(row, allow_nan=False)
    assert row["surface_max"] is None and 0.0 < row["iou"] < 1.0


def test_leaving_out_one_metric_changes_no_other() -> None:
    assembly = Assembly(HALVES, FRAME)
    full = resfit.evaluate(assembly, TARGET, features=lambda mesh, points: points - 90.0)
    less = resfit.evaluate(assembly, TARGET, emd=False)
    for key, value in less.items():
        if key not in ("emd", "intra_prim", "inter_prim"):
            assert value == full[key], key
    assert full["intra_prim"] is not None and full["inter_prim"] > 0.0 and full["emd"] < 0.1


def test_features_follow_the_nearest_part() -> None:
    def sides(mesh: Path, points: np.ndarray) -> np.ndarray:
        return np.where(points[:, :1] < 100.0, [[1.0, 0.0]], [[0.0, 1.0]])

    halves = (cuboid("a", (-0.45, 0, 0), (0.9, 0.9, 0.9)), cuboid("b", (0.45, 0, 0), (0.9, 0.9, 0.9)))
    for prediction in (
        Assembly(halves, FRAME),
        [box_mesh((95.5, 0, 0), (9, 9, 9)), box_mesh((104.5, 0, 0), (9, 9, 9))],
    ):
        row = resfit.evaluate(prediction, TARGET, emd=False, features=sides)
        assert row["intra_prim"] == pytest.approx(0.0, abs=1e-9)
        assert row["inter_prim"] == pytest.approx(np.sqrt(2.0))


def test_open_target_leads_with_distances() -> None:
    sheet = trimesh.Trimesh(
        [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], process=False
    )
    row = resfit.evaluate([box_mesh((1.0, 0.5, 0.0), (2.0, 1.0, 0.02))], sheet, emd=False)
    assert next(iter(row)) == "surface_mean" and not row["closed"]
    assert row["target_kind"] == "shell" and "shell" in row["target_rule"]
    # The box's faces are 0.01 * 0.9 from the sheet.
    assert row["surface_mean"] == pytest.approx(0.005, abs=0.005) and row["surface_max"] < 0.012


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "off", "glb"])
def test_bodies_of_a_file_without_nodes_are_parts(tmp_path: Path, suffix: str) -> None:
    both = trimesh.util.concatenate([box_mesh((0, 0, 0), (1, 1, 1)), box_mesh((2, 0, 0), (1, 1, 1))])
    both.export(tmp_path / f"both.{suffix}")
    source = read_prediction(tmp_path / f"both.{suffix}")
    assert isinstance(source, PartFile) and len(source.parts) == 2 and source.floats == 48


def test_nodes_may_have_any_digits_in_their_names(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    for number, name in enumerate(("part_10", "part_2", "1\u00b2", "\u0664", "9" * 5000)):
        scene.add_geometry(box_mesh((3.0 * number, 0.0, 0.0), (1.0, 1.0, 1.0)), name, name)
    scene.export(tmp_path / "parts.glb")
    found = read_prediction(tmp_path / "parts.glb")
    assert isinstance(found, PartFile) and len(found.parts) == 5


def test_hostile_files_are_no_danger_here_either(tmp_path: Path) -> None:
    # A name that is no text.
    assert len(read_prediction(INPUTS / "glb_name_surrogate.glb").parts) == 1
    # Indices without data, which trimesh would make gigabytes of.
    file = GltfFile()
    file.node(mesh=file.mesh(corners=file.bare_accessor(componentType=5125, count=10**9, type="SCALAR")))
    with pytest.raises(InputError, match="accessor"):
        read_prediction(file.save(tmp_path))
    (tmp_path / "far.obj").write_text("o a\nv 0 0 0\nv 1 0 0\nv 0 1 nan\nf 1 2 3\n")
    with pytest.raises(InputError, match=r"far\.obj"):
        read_prediction(tmp_path / "far.obj")
    (tmp_path / "empty.glb").write_bytes(b"")
    for path, said in ((tmp_path / "empty.glb", "empty"), (tmp_path / "gone.glb", "no file")):
        with pytest.raises(InputError, match=said):
            read_prediction(path)


def test_objects_of_an_obj_are_parts_though_they_touch(tmp_path: Path) -> None:
    lines, count = [], 0
    for name, x in (("convex_0", 0.0), ("convex_1", 1.0)):
        mesh = box_mesh((x, 0, 0), (1, 1, 1))
        lines += [f"o {name}", *(f"v {a} {b} {c}" for a, b, c in mesh.vertices)]
        lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1 + count]
        count += 8
    (tmp_path / "hulls.obj").write_text("\n".join(lines) + "\n")
    assert len(read_prediction(tmp_path / "hulls.obj").parts) == 2


def test_a_cavity_belongs_to_its_body() -> None:
    inner = box_mesh((0, 0, 0), (0.5, 0.5, 0.5))
    inner.invert()
    source = read_prediction(trimesh.util.concatenate([box_mesh((0, 0, 0), (1, 1, 1)), inner]))
    assert len(source.parts) == 1 and source.floats == 3 * 16 + 3 * 24
    found = PartsPrediction(source.placed(None, Transform()), source.floats, "cpu")
    inside = found.inside(np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.6, 0.0, 0.0]], np.float32))
    assert inside.tolist() == [False, True, False]


def test_inverted_parts_are_turned() -> None:
    mesh = box_mesh((0, 0, 0), (1, 1, 1))
    part = PartMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces)[:, ::-1])
    assert PartsPrediction([part], 24, "cpu").occupancy().union.sum() == 64**3


def test_cells_of_many_parts_are_those_of_their_planes(rng: np.random.Generator) -> None:
    axis = (2.0 * np.arange(128) + 1.0) / 128 - 1.0
    cells = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    parts, count = [], np.zeros(len(cells), int)
    for _ in range(6):
        hull = trimesh.convex.convex_hull(rng.normal(size=(20, 3)) * 0.15 + rng.uniform(-0.9, 0.9, 3))
        parts.append(PartMesh(np.asarray(hull.vertices), np.asarray(hull.faces)))
        offset = (hull.face_normals * hull.triangles[:, 0]).sum(axis=1)
        near = np.flatnonzero(((cells >= hull.bounds[0]) & (cells <= hull.bounds[1])).all(axis=1))
        count[near] += (cells[near] @ hull.face_normals.T < offset).all(axis=1)
    found = PartsPrediction(parts, 0, "cpu").occupancy()
    assert (found.count.ravel() != count).sum() <= 2


def test_drawn_points_are_on_the_outside_of_the_union() -> None:
    boxes = [box_mesh((-0.2, 0, 0), (0.8, 0.8, 0.8)), box_mesh((0.3, 0, 0), (0.8, 0.6, 0.6))]
    parts = [PartMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces)) for mesh in boxes]
    points = PartsPrediction(parts, 0, "cpu").draw(5000, np.random.default_rng(0))
    depth = [np.abs(points - mesh.bounds.mean(axis=0)) - 0.5 * mesh.extents for mesh in boxes]
    assert len(points) == 5000 and np.min([d.max(axis=1) for d in depth], axis=0).min() > -1e-5


def test_surfaces_that_coincide_are_drawn_once() -> None:
    boxes = [box_mesh((-0.2, 0, 0), (0.8, 0.5, 0.5)), box_mesh((0.2, 0, 0), (0.8, 0.5, 0.5))]
    parts = [PartMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces)) for mesh in boxes]
    points = PartsPrediction(parts, 0, "cpu").draw(8000, np.random.default_rng(0))
    # Of the sides, 1.2 long, the middle 0.4 is of both boxes; the ends take up 0.5 of 2.9.
    middle = (np.abs(points[:, 0]) < 0.2).mean()
    assert middle == pytest.approx(0.8 / 2.9, abs=0.02)


@pytest.mark.parametrize("content", ["", "{}", "not json"])
def test_bad_assembly(tmp_path: Path, content: str) -> None:
    (tmp_path / "assembly.json").write_text(content)
    with pytest.raises(InputError):
        resfit.evaluate(tmp_path, TARGET)


def test_what_is_no_prediction(tmp_path: Path) -> None:
    (tmp_path / "broken.glb").write_bytes(b"glTF nonsense")
    trimesh.PointCloud(np.eye(3)).export(tmp_path / "cloud.ply")
    for source in (
        "missing.glb",
        tmp_path / "broken.glb",
        tmp_path / "cloud.ply",
        3,
        [3],
        np.eye(3),
        "x.txt",
    ):
        with pytest.raises(InputError):
            resfit.evaluate(source, TARGET)
