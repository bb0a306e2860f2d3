"""Fitting part by part: how meshes are taken apart, which parts are copies, and what the pieces come to together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
import warp as wp
from work import calls_of

import resfit
from resfit.assembly.change_of_frame import rescale_rows
from resfit.fitter.config import FitConfig
from resfit.fitter.pipeline import takes_apart
from resfit.fitter.regularise.rigid_motion import move_rows
from resfit.fitter.search.per_part import choose_pieces, fit_parts, name_primitives
from resfit.kernels.field.evaluate import evaluate_primitives
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.primitives import family
from resfit.kernels.rows import BLEND, ROTATION, SHAPE, SHAPES, TRANSLATION, empty_rows
from resfit.shape.parts import Piece, _names_of_nodes, piece_target, split_target
from resfit.shape.repeated_parts import find_copies
from resfit.shape.target import Target, make_target
from resfit.shape.topology import label_touching


def cart() -> trimesh.Scene:
    """A box on four wheels, each a node; the wheels on the right are those on the left, mirrored."""
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box((4.0, 1.0, 2.0)), node_name="body")
    wheel = trimesh.creation.cylinder(0.6, 0.3, sections=24)
    for name, x, z in (("wheel_fl", 1.5, 1.3), ("wheel_fr", 1.5, -1.3), ("wheel_bl", -1.5, 1.3)):
        scene.add_geometry(
            wheel, node_name=name, transform=trimesh.transformations.translation_matrix((x, -0.6, z))
        )
    return scene


def test_random_suffixes_are_no_names_but_numbers_are() -> None:
    names = ["body_802ccc", "body_000123", "bolt_000001", "bolt_000002", "skirts_1a2b3c", "arm_12345", "leg"]
    assert _names_of_nodes(names) == [
        "body",
        "body",
        "bolt_000001",
        "bolt_000002",
        "skirts",
        "arm_12345",
        "leg",
    ]


@pytest.fixture(scope="module")
def target() -> Target:
    from resfit.kernels.runtime.launch import choose_device

    return make_target(cart(), choose_device("cpu"), 64, 2000)


def test_nodes_are_parts(target: Target) -> None:
    pieces = split_target(target)
    assert [piece.name for piece in pieces] == ["body", "wheel_fl", "wheel_fr", "wheel_bl"]
    assert pieces[0].share > 0.5 and sum(piece.share for piece in pieces) == pytest.approx(1.0, abs=0.05)


def test_materials_of_a_node_are_one_part(device: wp.Device) -> None:
    # What trimesh makes of a node with several materials: names with random ends, and open halves.
    box, ball = trimesh.creation.box(), trimesh.creation.icosphere(2)
    ball.apply_translation((3.0, 0.0, 0.0))
    scene = trimesh.Scene()
    upper = box.triangles_center[:, 2] > 0.1
    for name, faces in (("crate_0a1b2c", upper), ("crate_ffee00", ~upper)):
        scene.add_geometry(trimesh.Trimesh(box.vertices, box.faces[faces], process=False), node_name=name)
    scene.add_geometry(ball, node_name="ball")
    pieces = split_target(make_target(scene, device, 32, 500))
    assert [piece.name for piece in pieces] == ["crate", "ball"]
    assert len(pieces[0].winding_faces) == 12


def test_bodies_are_parts_and_cavities_stay_inside(device: wp.Device) -> None:
    outer, inner = trimesh.creation.icosphere(2, 1.0), trimesh.creation.icosphere(2, 0.5)
    inner.invert()
    small = trimesh.creation.box((0.5, 0.5, 0.5))
    small.apply_translation((2.0, 0.0, 0.0))
    mesh = trimesh.util.concatenate([small, outer, inner])
    pieces = split_target(make_target(mesh, device, 32, 500))
    assert [piece.name for piece in pieces] == ["body_01", "body_02"]
    assert len(pieces[0].winding_faces) == len(outer.faces) + len(inner.faces)


def test_a_part_is_as_large_in_its_own_frame(target: Target, device: wp.Device) -> None:
    body = split_target(target)[0]
    own = piece_target(body, target, device, 64, 1000, 0)
    assert own.volume * own.transform.scale**3 == pytest.approx(8.0 / target.transform.scale**3, rel=0.02)
    np.testing.assert_allclose(own.upper - own.lower, np.array([1.8, 0.45, 0.9]), atol=1e-5)


def test_copies_are_found_however_they_are_turned(rng: np.random.Generator) -> None:
    mesh = trimesh.creation.box((1.0, 2.0, 3.0)).subdivide()
    mesh.vertices[mesh.vertices[:, 0] > 0.4] *= (1.0, 0.7, 0.9)
    mesh.vertices[:, 1] += 0.1 * mesh.vertices[:, 2] ** 2 + 0.1 * mesh.vertices[:, 2]
    turn = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
    mirror = np.diag([1.0, -1.0, 1.0])

    def piece(vertices: np.ndarray, faces: np.ndarray) -> Piece:
        no_sheets = np.zeros((0, 3), np.int32)
        return Piece("p", vertices.astype(np.float32), faces.astype(np.int32), no_sheets, 0.1)

    order = rng.permutation(len(mesh.faces))
    renumber = rng.permutation(len(mesh.vertices))
    shuffled = np.empty_like(mesh.vertices)
    shuffled[renumber] = mesh.vertices
    pieces = [
        piece(mesh.vertices, mesh.faces),
        piece(mesh.vertices @ turn.T + 5.0, mesh.faces),
        piece(mesh.vertices @ mirror.T - 2.0, mesh.faces[:, ::-1]),
        piece(shuffled @ turn.T, renumber[mesh.faces][order]),
        piece(mesh.vertices * (1.0, 1.0, 1.02), mesh.faces),
    ]
    found = find_copies(pieces)
    assert found[0] is None and found[4] is None
    for index in (1, 2, 3):
        copy = found[index]
        assert copy is not None and copy.source == 0
        moved = mesh.vertices @ copy.turn.T + copy.shift
        expected = pieces[index].vertices[renumber] if index == 3 else pieces[index].vertices
        np.testing.assert_allclose(moved, expected, atol=1e-4)
    assert found[2] is not None
    np.testing.assert_array_equal(found[2].turn, mirror)


def random_rows(rng: np.random.Generator, count: int) -> np.ndarray:
    """Bent, tapered, hollow SuperFrusta in random poses."""
    rows = empty_rows(count)
    rows[:, TRANSLATION : TRANSLATION + 3] = rng.uniform(-0.4, 0.4, (count, 3))
    quaternions = rng.normal(size=(count, 4))
    rows[:, ROTATION : ROTATION + 4] = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    for row in rows:
        row[SHAPES : SHAPES + SHAPE] = family("superfrustum").shape_row(
            size=rng.uniform(0.2, 0.6, 3), roundness=0.4, dilation=0.03, taper=0.7, bulge=0.4, onion=0.2
        )
    rows[:, BLEND] = 0.04
    return rows


@pytest.mark.parametrize("mirrored", [False, True])
def test_moved_primitives_have_the_moved_field(
    device: wp.Device, rng: np.random.Generator, mirrored: bool
) -> None:
    rows, names = random_rows(rng, 4), ["superfrustum"] * 4
    turn = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
    turn = turn @ np.diag([1.0, 1.0, -1.0]) if mirrored else turn
    centre, shift = rng.uniform(-0.2, 0.2, (2, 3))
    points = rng.uniform(-0.8, 0.8, (500, 3))
    there = (points - centre) @ turn.T + centre + shift
    before = evaluate_primitives(PrimitiveSet(rows, names, device), points.astype(np.float32))
    moved = PrimitiveSet(move_rows(rows, turn, centre, shift), names, device)
    after = evaluate_primitives(moved, there.astype(np.float32))
    np.testing.assert_allclose(after, before, atol=1e-5)
    larger = PrimitiveSet(rescale_rows(rows, names, 0.5, (0.1, 0.2, 0.3)), names, device)
    scaled = evaluate_primitives(larger, (0.5 * points + (0.1, 0.2, 0.3)).astype(np.float32))
    np.testing.assert_allclose(scaled, 0.5 * before, atol=1e-5)


def test_parts_keep_their_names_and_copies_are_equal() -> None:
    result = resfit.fit(cart(), preset="fast", device="cpu", per_part="on")
    parts = {part.name: part for part in result.assembly.primitives}
    assert {"body", "wheel_fl", "wheel_fr", "wheel_bl"} <= set(parts)
    assert result.metrics["iou"] > 0.95
    left, right = parts["wheel_fl"], parts["wheel_fr"]
    assert left.parameters == right.parameters
    copies = [relation for relation in result.relations if relation["kind"] == "copy"]
    assert {tuple(relation["parts"]) for relation in copies} >= {
        ("wheel_fl", "wheel_fr"),
        ("wheel_fl", "wheel_bl"),
    }
    assert "2 of them copies of others" in result.notes[0]


def test_few_primitives_and_stops(target: Target, device: wp.Device) -> None:
    few = fit_parts(target, FitConfig(preset="fast", max_primitives=2), device)
    assert few is not None and len(few.outcome.rows) == 2 and "the 2 largest of 4 parts" in few.notes[0]
    stopped = fit_parts(target, FitConfig(preset="fast"), device, should_stop=lambda: True)
    assert stopped is not None and stopped.outcome.status.stopped_early and len(stopped.outcome.rows) == 0


def test_when_a_mesh_is_taken_apart() -> None:
    def pieces(*shares: float) -> list[Piece]:
        nothing = np.zeros((0, 3), np.int32)
        return [Piece("p", np.zeros((0, 3)), nothing, nothing, share) for share in shares]

    config = FitConfig()
    assert choose_pieces(pieces(0.2, 0.5, 0.3), config, False) == [0, 1, 2]
    assert choose_pieces(pieces(0.5, 0.5, 0.0001), config, False) == []
    assert choose_pieces(pieces(0.9, 0.05, 0.05), config, False) == []
    assert choose_pieces(pieces(0.9, 0.05, 0.0001), config, True) == [0, 1, 2]
    assert choose_pieces(pieces(1.0), config, True) == []
    assert takes_apart(config) and not takes_apart(replace(config, per_part="off"))
    assert not takes_apart(replace(config, tolerance=0.1)) and not takes_apart(
        replace(config, target_iou=0.9)
    )
    assert takes_apart(replace(config, tolerance=0.1, per_part="on"))


def test_names_of_primitives() -> None:
    assert name_primitives(["wheel", "axle", "wheel", "wheel"]) == ["wheel", "axle", "wheel.2", "wheel.3"]


def test_regular_parts_keep_names_and_copies() -> None:
    result = resfit.fit(cart(), preset="fast", device="cpu", per_part="on", snap=True, rounds=1)
    parts = {part.name: part for part in result.assembly.primitives}
    assert {"body", "wheel_fl", "wheel_fr", "wheel_bl"} <= set(parts)
    for relation in result.relations:
        if relation["kind"] == "copy":
            first, second = (parts[name] for name in relation["parts"])
            assert first.parameters == second.parameters
    assert result.snapped and result.metrics["iou"] > 0.9


def test_many_nodes_are_taken_apart_at_once(device: wp.Device) -> None:
    count = 150
    box = trimesh.creation.box((0.5, 0.5, 0.5))
    scene = trimesh.Scene()
    for index in range(count):
        scene.add_geometry(
            box,
            node_name=f"box_{index}_",
            transform=trimesh.transformations.translation_matrix((index, 0, 0)),
        )
    target = make_target(scene, device, 16, 200)
    pieces: list[Piece] = []
    calls = calls_of(lambda: pieces.extend(split_target(target)))
    assert [piece.name for piece in pieces] == [f"box_{index}_" for index in range(count)]
    assert all(len(piece.vertices) == 8 and len(piece.winding_faces) == 12 for piece in pieces)
    assert calls < 40 * count


def test_many_open_bodies_are_joined_at_once(rng: np.random.Generator, device: wp.Device) -> None:
    count = 200
    cup = trimesh.creation.box((0.2, 0.2, 0.2))
    faces = cup.faces[cup.face_normals[:, 2] < 0.5]
    vertices = (cup.vertices + rng.uniform(-1.0, 1.0, (count, 1, 3))).reshape(-1, 3)
    mesh = trimesh.Trimesh(
        vertices, (faces + 8 * np.arange(count)[:, None, None]).reshape(-1, 3), process=False
    )
    target = make_target(mesh, device, 16, 200)
    assert calls_of(lambda: split_target(target)) < 60 * count


@pytest.mark.parametrize("size", [0.05, 0.2, 1.5])
def test_boxes_are_grouped_by_touching(size: float, rng: np.random.Generator) -> None:
    low = rng.uniform(-1.0, 1.0, (120, 3))
    high = low + rng.uniform(0.0, size, (120, 3))
    touching = ((low[:, None] <= high) & (high[:, None] >= low)).all(axis=2)
    expected = np.arange(120)
    for _ in range(120):
        expected = np.where(touching, expected, 120).min(axis=1)
    np.testing.assert_array_equal(label_touching(low, high), expected)
