"""Meshes of unions and of single parts: closed, facing outwards, with sharp edges, on the field's zero set."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import trimesh
import warp as wp

from resfit.kernels.contour import isosurface
from resfit.kernels.contour.dual_contour_topology import EDGE_ENDS, ambiguous_faces, cell_patches, face_links
from resfit.kernels.contour.isosurface import extract_isosurface
from resfit.kernels.contour.part_isosurface import part_isosurface
from resfit.kernels.field.bounds import primitive_bounds
from resfit.kernels.field.evaluate import evaluate_assembly, evaluate_primitives
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.primitives import family
from resfit.kernels.rows import BLEND, GATE, ROTATION, SHAPE, SHAPES, TRANSLATION, empty_rows

TURNED = (0.8, 0.3, -0.4, 0.25)
"""A rotation that puts no face along an axis."""


def assembly(device: wp.Device, *items: tuple[str, dict[str, Any]], **columns: Any) -> PrimitiveSet:
    """Primitives (family, parameters), each turned; `at` and `blend` give all positions and blends."""
    rows = empty_rows(len(items))
    for row, (name, parameters) in zip(rows, items, strict=True):
        row[SHAPES : SHAPES + SHAPE] = family(name).shape_row(**parameters)
        row[ROTATION : ROTATION + 4] = np.array(TURNED) / np.linalg.norm(TURNED)
    rows[:, TRANSLATION : TRANSLATION + 3] = columns.get("at", 0.0)
    rows[:, BLEND] = columns.get("blend", 0.0)
    rows[:, GATE] = columns.get("gate", 1.0)
    return PrimitiveSet(rows, [name for name, _ in items], device)


EXACT = ("cuboid", "superfrustum", "superprimitive")
"""Families whose field is a distance near the surface."""


def random_assembly(
    device: wp.Device,
    rng: np.random.Generator,
    count: int,
    families: tuple[str, ...] = (*EXACT, "superquadric"),
) -> PrimitiveSet:
    """Overlapping primitives, some blended, bent, tapered, hollow."""
    names = rng.choice(families, count)
    rows = empty_rows(count)
    for row, name in zip(rows, names, strict=True):
        parameters: dict[str, Any] = {"size": rng.uniform(0.05, 0.5, 3)}
        if name in {"superfrustum", "superprimitive"}:
            parameters |= {"roundness": rng.random(), "dilation": 0.05 * rng.random()}
            parameters["onion"] = rng.uniform(-1.0, 0.8)
        if name == "superfrustum":
            parameters |= {"taper": 2.0 * rng.random(), "bulge": rng.uniform(-1, 1) * (rng.random() < 0.5)}
        if name == "superquadric":
            parameters["exponents"] = rng.uniform(0.2, 1.8, 2)
        row[SHAPES : SHAPES + SHAPE] = family(name).shape_row(**parameters)
        row[TRANSLATION : TRANSLATION + 3] = rng.uniform(-0.8, 0.8, 3)
        row[ROTATION : ROTATION + 4] = rng.normal(size=4)
        row[BLEND] = 0.15 * rng.random() * (rng.random() < 0.5)
    return PrimitiveSet(rows, list(names), device)


def checked(surface: tuple[np.ndarray, np.ndarray]) -> trimesh.Trimesh:
    """The mesh, after a look at whether it is closed and faces outwards."""
    mesh = trimesh.Trimesh(*surface, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume > 0.0
    assert surface[0].dtype == np.float32 and surface[1].dtype == np.int32
    return mesh


FRUSTUM = "superfrustum"
SOLIDS: dict[str, tuple[tuple[str, dict[str, Any]], float, int]] = {
    "box": (("cuboid", {"size": (1, 0.7, 0.5)}), 0.35, 2),
    "sphere": ((FRUSTUM, {"size": (0, 0, 0), "dilation": 0.5}), math.pi / 6, 2),
    "capsule": ((FRUSTUM, {"size": (0, 0, 1), "dilation": 0.2}), math.pi * (0.04 + 4 / 3 * 0.008), 2),
    "cylinder": ((FRUSTUM, {"size": (0.8, 0.8, 1), "roundness": 1}), math.pi * 0.16, 2),
    "cone": ((FRUSTUM, {"size": (1, 1, 1), "roundness": 1, "taper": 0}), math.pi / 12, 2),
    "pyramid": ((FRUSTUM, {"size": (1, 1, 1), "taper": 0}), 1 / 3, 2),
    "tube": ((FRUSTUM, {"size": (1, 1, 0.8), "roundness": 1, "onion": 0.7}), math.pi * 0.2 * 0.51, 0),
    "torus": (
        (FRUSTUM, {"size": (1, 1, 0), "roundness": 1, "onion": 1, "dilation": 0.15}),
        2 * math.pi**2 * 0.5 * 0.0225,
        0,
    ),
    "beam": ((FRUSTUM, {"size": (0.2, 0.4, 1), "bulge": 1}), 0.08 * math.pi / 2, 2),
    "ellipsoid": (("superquadric", {"size": (1, 0.6, 0.8)}), math.pi / 6 * 0.48, 2),
}
"""Primitive, volume, Euler number."""


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_have_their_volume_and_genus(name: str, device: wp.Device) -> None:
    primitive, volume, euler = SOLIDS[name]
    primitives = assembly(device, primitive, at=(0.1, -0.2, 0.05))
    whole = checked(extract_isosurface(primitives, 64))
    part = checked(part_isosurface(primitives, 0, 48))
    for mesh in (whole, part):
        assert mesh.volume == pytest.approx(volume, rel=5e-3)
    # A sharp apex may come off the rest where a cell holds just its tip.
    assert part.euler_number == euler
    assert whole.euler_number == euler or name in {"cone", "pyramid"}
    np.testing.assert_allclose(part.bounds, whole.bounds, atol=0.01)


def test_sharp_edges_of_a_turned_box_are_kept(device: wp.Device) -> None:
    primitives = assembly(device, ("cuboid", {"size": (1, 0.7, 0.5)}))
    for resolution in (32, 64):
        mesh = checked(extract_isosurface(primitives, resolution))
        cell = float(mesh.extents.max()) / resolution
        for points in (mesh.vertices, mesh.triangles_center):
            assert np.abs(evaluate_assembly(primitives, points)).max() < 0.02 * cell
        assert mesh.volume == pytest.approx(0.35, rel=1e-4)


def test_random_assemblies_are_closed(device: wp.Device, rng: np.random.Generator) -> None:
    for _ in range(4):
        primitives = random_assembly(device, rng, 16)
        for resolution in (20, 56):
            checked(extract_isosurface(primitives, resolution))


def test_vertices_are_on_the_surface(device: wp.Device, rng: np.random.Generator) -> None:
    for _ in range(3):
        primitives = random_assembly(device, rng, 16, EXACT)
        mesh = checked(extract_isosurface(primitives, 64))
        cell = float(mesh.extents.max()) / 64
        distance = np.abs(evaluate_assembly(primitives, mesh.vertices)) / cell
        assert np.quantile(distance, 0.99) < 2e-3
        assert distance.max() < 1.0


def test_assembly_may_leave_the_unit_cube(device: wp.Device) -> None:
    box = ("cuboid", {"size": (0.5, 0.5, 0.5)})
    primitives = assembly(device, box, box, at=[(-2, 0, 0), (3, 1, 0)])
    mesh = checked(extract_isosurface(primitives, 64))
    assert mesh.body_count == 2
    assert mesh.volume == pytest.approx(0.25, rel=1e-2)


def test_smooth_joins_swell_beyond_the_parts(device: wp.Device) -> None:
    ball = (FRUSTUM, {"size": (0, 0, 0), "dilation": 0.3})
    primitives = assembly(device, ball, ball, blend=0.4)
    mesh = checked(extract_isosurface(primitives, 40))
    # Two equal distances join to that less a quarter of the blend.
    assert mesh.volume == pytest.approx(4 / 3 * math.pi * 0.4**3, rel=1e-2)


def test_too_small_bounds_are_enlarged(device: wp.Device) -> None:
    primitives = assembly(device, (FRUSTUM, {"size": (0, 0, 0), "dilation": 0.5}))
    low, high = np.full(3, -0.5), np.array([0.1, 0.5, 0.5])
    mesh = checked(extract_isosurface(primitives, 32, (low, high)))
    assert mesh.volume == pytest.approx(math.pi / 6, rel=1e-2)


def test_a_field_without_an_outside_takes_no_endless_grid(
    device: wp.Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts = []
    sample = isosurface._sample

    def counted(*grid: Any) -> np.ndarray:
        samples = sample(*grid)
        counts.append(samples.size)
        return samples

    monkeypatch.setattr(isosurface, "_sample", counted)
    huge = (FRUSTUM, {"size": (1e30, 1e30, 1e30), "roundness": 1.0})
    extract_isosurface(assembly(device, huge), 32)
    assert max(counts) < 2 * isosurface.MAX_GROWTH * 32**3


def test_nothing_gives_nothing(device: wp.Device) -> None:
    gone = assembly(device, ("cuboid", {"size": (1, 1, 1)}), gate=0.0)
    for primitives in (PrimitiveSet(empty_rows(0), [], device), gone):
        vertices, faces = extract_isosurface(primitives)
        assert vertices.shape == (0, 3) and faces.shape == (0, 3)


def test_resolution_is_checked(device: wp.Device) -> None:
    primitives = assembly(device, ("cuboid", {"size": (1, 1, 1)}))
    with pytest.raises(ValueError, match="resolution"):
        extract_isosurface(primitives, 1)
    with pytest.raises(ValueError, match="resolution"):
        part_isosurface(primitives, 0, 0)


THIN: dict[str, tuple[dict[str, Any], float]] = {
    "plate": ({"size": (1, 1, 0.002)}, 0.002),
    "rod": ({"size": (0.002, 0.002, 1), "roundness": 1}, math.pi * 1e-6),
    "half shell": ({"size": (0.002, 1, 1), "bulge": 1}, 0.001 * math.pi),
    "shell bent the other way": (
        {"size": (0.004, 0.7, 1), "bulge": -0.5},
        0.0028 * math.pi / 4 * math.sqrt(2),
    ),
    "thin tube": ({"size": (1, 1, 0.8), "roundness": 1, "onion": 0.97}, 0.2 * math.pi * (1 - 0.97**2)),
    "wire": (
        {"size": (0, 0, 1), "dilation": 0.005, "bulge": 1},
        2.5e-5 * math.pi * (math.pi / 2 + 4 / 3 * 0.005),
    ),
}


@pytest.mark.parametrize("name", THIN)
def test_thin_parts_keep_whole(name: str, device: wp.Device) -> None:
    parameters, volume = THIN[name]
    other = ("cuboid", {"size": (1, 1, 1)})
    primitives = assembly(device, other, (FRUSTUM, parameters), at=(0.2, 0.1, -0.3))
    mesh = checked(part_isosurface(primitives, 1, 48))
    assert mesh.body_count == 1
    assert mesh.volume == pytest.approx(volume, rel=0.01)
    assert np.abs(evaluate_primitives(primitives, mesh.vertices)[1]).max() < 1e-5


def test_boxes_hold_their_primitives(device: wp.Device, rng: np.random.Generator) -> None:
    primitives = random_assembly(device, rng, 60)
    points = rng.uniform(-1.3, 1.3, (60_000, 3)).astype(np.float32)
    for inside, (low, high) in zip(
        evaluate_primitives(primitives, points) < 0.0, primitive_bounds(primitives), strict=True
    ):
        assert (points[inside] >= low - 1e-5).all() and (points[inside] <= high + 1e-5).all()


def test_patches_close_in_every_cell() -> None:
    for inside in range(256):
        ambiguous = ambiguous_faces(inside)
        for joined in {0, ambiguous, ambiguous & 0b010101}:
            patches, count, _ = cell_patches(inside, joined)
            crossed = {e for e, (a, b) in enumerate(EDGE_ENDS) if (inside >> a ^ inside >> b) & 1}
            assert {e for e in range(12) if patches[e] >= 0} == crossed
            assert set(patches) - {-1} == set(range(count))
            links = [pair for face in range(6) for pair in face_links(face, inside, bool(joined >> face & 1))]
            # Each crossed edge is on two faces, so that patches are loops.
            assert sorted(e for pair in links for e in pair) == sorted([*crossed, *crossed])
            assert all(patches[a] == patches[b] for a, b in links)
