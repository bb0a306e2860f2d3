"""Slanted meshes are fitted in their Manhattan frame, and come back where they were."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import warp as wp
from plain_shapes import plain_shape
from scipy.spatial.transform import Rotation

import resfit
from resfit.fitter.config import preset_config
from resfit.fitter.search.standing import fit_standing, stand
from resfit.kernels.field.evaluate import evaluate_primitives
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.shape.manhattan_frame import manhattan_frame
from resfit.shape.target import make_target

BOX = (88.0, 60.0, 29.0)


def open_box(turn: np.ndarray) -> trimesh.Trimesh:
    """A box of 88 x 60 x 29 with walls and a floor of 3, open at the top, turned."""
    outer, inner = (np.array(BOX) / 2, np.array([82.0, 54.0, 0.0]) / 2)
    corners = [(x, y) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    rings = [
        [(x * outer[0], y * outer[1], -outer[2]) for x, y in corners],
        [(x * outer[0], y * outer[1], outer[2]) for x, y in corners],
        [(x * inner[0], y * inner[1], outer[2]) for x, y in corners],
        [(x * inner[0], y * inner[1], 3.0 - outer[2]) for x, y in corners],
    ]
    faces = [(0, 2, 1), (0, 3, 2), (12, 13, 14), (12, 14, 15)]
    for ring in range(3):
        for k in range(4):
            a, b = 4 * ring + k, 4 * ring + (k + 1) % 4
            faces += [(a, b, b + 4), (a, b + 4, a + 4)]
    mesh = trimesh.Trimesh(np.concatenate(rings) @ turn.T, faces)
    assert mesh.is_watertight and mesh.volume > 0
    return mesh


def tilt(seed: int) -> np.ndarray:
    return Rotation.random(random_state=seed).as_matrix()


@pytest.mark.parametrize("name", ["box", "cylinder", "tube", "thin rod", "thin plate"])
def test_the_frame_of_a_turned_shape_stands_it_straight(name: str) -> None:
    mesh = plain_shape(name, turned=True)
    frame = manhattan_frame(mesh.vertices, mesh.faces)
    assert frame is not None
    assert np.allclose(frame @ frame.T, np.eye(3), atol=1e-9) and np.linalg.det(frame) > 0.0
    straight = trimesh.Trimesh(mesh.vertices @ frame.T, mesh.faces)
    upright = plain_shape(name, turned=False)
    assert np.allclose(
        sorted(np.ptp(straight.vertices, axis=0)), sorted(np.ptp(upright.vertices, axis=0)), rtol=2e-3
    )


@pytest.mark.parametrize("name", ["box", "cylinder", "sphere", "torus"])
def test_what_stands_straight_or_has_no_axes_has_no_frame(name: str) -> None:
    mesh = plain_shape(name, turned=False)
    assert manhattan_frame(mesh.vertices, mesh.faces) is None


def test_a_frame_turns_as_little_as_it_can() -> None:
    small = Rotation.from_rotvec([0.0, 0.0, np.radians(8.0)]).as_matrix()
    mesh = trimesh.creation.box(BOX)
    frame = manhattan_frame(mesh.vertices @ small.T, mesh.faces)
    assert frame is not None
    assert np.allclose(frame, small.T, atol=1e-6)


def test_rows_go_forth_and_come_back(device: wp.Device, rng: np.random.Generator) -> None:
    target = make_target(open_box(tilt(3)), device, 64, 2000)
    config = preset_config("fast", samples=2000)
    standing = stand(target, config, device)
    assert standing is not None
    rows = fit_standing(target, config, device).rows
    there = standing.forth(rows)
    back = standing.back(there)
    points = rng.uniform(-1.0, 1.0, (500, 3)).astype(np.float32)
    names = ["superfrustum"] * len(rows)
    for row, other in zip(rows, back, strict=True):
        one, two = (
            evaluate_primitives(PrimitiveSet(r[None], names[:1], device), points)[0] for r in (row, other)
        )
        assert np.abs(one - two).max() < 1e-5
    # The same solid in both frames: distances differ by the scale alone.
    moved = ((points @ standing.rotation.T - standing.offset) / standing.scale).astype(np.float32)
    own, turned = (
        evaluate_primitives(PrimitiveSet(r, names, device), p) for r, p in ((rows, points), (there, moved))
    )
    assert np.abs(own - standing.scale * turned).max() < 1e-5


@pytest.mark.parametrize("seed", [1, 2])
def test_a_turned_open_box_is_its_walls_and_its_floor(seed: int) -> None:
    result = resfit.fit(open_box(tilt(seed)), preset="fast")
    assert len(result.assembly.primitives) <= 5
    assert result.metrics["iou"] > 0.99
    assert result.deviation is not None and result.deviation.p95 < 0.001 * BOX[0]
    # Its story is told in the frame of the mesh, too.
    last = [entry for entry in result.history.rounds if entry.accepted][-1]
    inside = (np.abs(last.kept[:, :3]) < 1.0).all()
    assert inside and len(last.kept)
