"""Assembly and Primitive: exact float32 values, distances in the mesh's own frame, meshes, edge cases."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp

from resfit.assembly.assembly import Assembly
from resfit.assembly.colors import PALETTE, linear_rgb, palette_color, rgb
from resfit.assembly.primitive import Pose, Primitive
from resfit.assembly.provenance import Provenance, sha256_of_file
from resfit.assembly.transform import Transform
from resfit.errors import AssemblyError, InputError
from resfit.kernels.primitives import FAMILIES
from resfit.kernels.rows import ROW

QUARTER = float(np.sqrt(0.5))


def frustum(
    name: str = "box", size: Any = (0.4, 0.6, 0.8), pose: Pose | None = None, **fields: Any
) -> Primitive:
    """A superfrustum: a straight solid box unless told otherwise."""
    values: dict[str, Any] = {
        "size": size, "roundness": 0.0, "dilation": 0.0, "taper": 1.0, "bulge": 0.0, "onion": -1.0,
    }  # fmt: skip
    blend, color = fields.pop("blend", 0.0), fields.pop("color", PALETTE[0])
    return Primitive("superfrustum", name, pose or Pose(), values | fields, blend, color)


def random_assembly(rng: np.random.Generator, count: int) -> Assembly:
    """Primitives of all families with random legal values, somewhere far away."""
    primitives = []
    names = list(FAMILIES)
    for index in range(count):
        family = FAMILIES[names[index % len(names)]]
        parameters: dict[str, Any] = {}
        for entry in family.parameters:
            values = rng.uniform(max(entry.legal[0], -3.0), min(entry.legal[1], 3.0), entry.count)
            parameters[entry.name] = values if entry.count > 1 else values[0]
        rotation = rng.normal(size=4)
        pose = Pose(tuple(rng.normal(size=3)), tuple(rotation / np.linalg.norm(rotation)))
        color = palette_color(index)
        primitives.append(Primitive(family.name, f"part {index}", pose, parameters, rng.uniform(), color))
    return Assembly(tuple(primitives), Transform(rng.uniform(0.1, 9.0), tuple(rng.normal(size=3) * 1e6)))


def test_values_are_exact_float32_and_round_trip(rng: np.random.Generator, tmp_path: Path) -> None:
    assembly = random_assembly(rng, 60)
    path = tmp_path / "assembly.json"
    assembly.save(path)
    again = Assembly.load(path)
    assert again == assembly and hash(again.primitives) == hash(assembly.primitives)
    assert again.to_json() == assembly.to_json() == path.read_bytes()
    np.testing.assert_array_equal(again.rows(), assembly.rows())
    assert [entry.name for entry in tmp_path.iterdir()] == ["assembly.json"]


def test_short_decimals_stay_short() -> None:
    primitive = frustum(size=(np.float32(0.1), 1e-30, 123456.789), dilation=-0.0)
    assert primitive.parameters["size"] == (0.1, 1e-30, 123456.79)
    assert str(primitive.parameters["dilation"]) == "0.0"


def test_rows_and_back(rng: np.random.Generator) -> None:
    assembly = random_assembly(rng, 8)
    families = [primitive.family for primitive in assembly.primitives]
    colors = [primitive.color for primitive in assembly.primitives]
    again = Assembly.from_rows(assembly.rows(), families, colors, assembly.transform, assembly.provenance)
    np.testing.assert_array_equal(again.rows(), assembly.rows())
    assert [primitive.name for primitive in again.primitives][:2] == ["part_00", "part_01"]
    with pytest.raises(AssemblyError, match="numbers"):
        Primitive.from_row("cuboid", "a", np.zeros(3))
    with pytest.raises(AssemblyError, match="family"):
        Primitive.from_row("sphere", "a", np.zeros(ROW))


def test_quaternions() -> None:
    assert (
        Pose(rotation=(0.7071, 0.0, 0.7071, 0.0)).rotation == Pose(rotation=(QUARTER, 0, QUARTER, 0)).rotation
    )
    kept = Pose(rotation=(0.5, 0.5, 0.5, 0.5)).rotation
    assert kept == (0.5, 0.5, 0.5, 0.5)
    with pytest.raises(AssemblyError, match="rotation is zero"):
        Pose(rotation=(0.0, 0.0, 0.0, 0.0))
    with pytest.raises(AssemblyError, match="rotation has length 2"):
        Pose(rotation=(2.0, 0.0, 0.0, 0.0))
    turned = Pose(rotation=(QUARTER, 0.0, 0.0, QUARTER)).matrix() @ [1.0, 0.0, 0.0]
    np.testing.assert_allclose(turned, [0.0, 1.0, 0.0], atol=1e-6)


def test_primitives_are_read_only_and_travel() -> None:
    primitive = frustum()
    with pytest.raises(TypeError):
        primitive.parameters["taper"] = 3.0  # type: ignore[index]
    with pytest.raises(dataclasses.FrozenInstanceError):
        primitive.blend = 1.0  # type: ignore[misc]
    assembly = Assembly((primitive,), Transform(2.0), Provenance(seed=3))
    for copied in (pickle.loads(pickle.dumps(assembly)), copy.deepcopy(assembly)):
        assert copied == assembly
    assert dataclasses.replace(primitive, blend=0.5).blend == 0.5


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"taper": 2.1}, "parameters.taper is 2.1; it must lie in"),
        ({"taper": float("nan")}, "parameters.taper must be a finite number"),
        ({"taper": None}, "parameters.taper is null"),
        ({"taper": np.bool_(True)}, "parameters.taper is"),
        ({"size": (1, 2)}, "parameters.size has 2 values"),
        ({"size": 3}, "parameters.size is 3; it must be a list"),
        ({"size": np.float32(3)}, "parameters.size is"),
        ({"length": 3}, "parameters has an unknown field"),
        ({"blend": -1}, "blend is -1; it must be 0 or more"),
        ({"color": "blue"}, 'color is "blue"'),
        ({"color": None}, "color is null"),
        ({"name": "\ud800"}, "name is"),
    ],
)
def test_wrong_fields_are_named(fields: dict[str, Any], sentence: str) -> None:
    with pytest.raises(AssemblyError) as caught:
        frustum(**fields)
    assert str(caught.value).startswith(sentence)


def test_names_differ() -> None:
    with pytest.raises(AssemblyError, match=r"primitives\[1\]\.name is \"box\", as is that of"):
        Assembly((frustum(), frustum()))


def test_signed_distance_in_mesh_units(device: wp.Device) -> None:
    # A box 0.4 x 0.6 x 0.8, turned a quarter about z (so 0.6 x 0.4 x 0.8), doubled and moved.
    pose = Pose((0.1, 0.0, 0.0), (QUARTER, 0.0, 0.0, QUARTER))
    assembly = Assembly((frustum(pose=pose),), Transform(2.0, (10.0, 20.0, 30.0)))
    centre = np.array([10.2, 20.0, 30.0])
    points = centre + np.array([[0, 0, 0], [1.6, 0, 0], [0, 1.4, 0], [0, 0, 1.8], [0.6, 0, 0]])
    distance = assembly.sdf(points, device=device.alias)
    assert distance.dtype == np.float32
    np.testing.assert_allclose(distance, [-0.4, 1.0, 1.0, 1.0, 0.0], atol=2e-6)
    each = assembly.primitive_sdf(points, device=device.alias)
    assert each.shape == (5, 1) and each.dtype == np.float32
    np.testing.assert_allclose(each[:, 0], distance, atol=1e-6)


def test_far_from_the_origin_nothing_is_lost(rng: np.random.Generator, device: wp.Device) -> None:
    near = Assembly((frustum(), frustum("b", (0.2, 0.2, 1.5), blend=0.1)))
    far = dataclasses.replace(near, transform=Transform(1.0, (1e6, -1e6, 1e6)))
    points = rng.uniform(-1, 1, (500, 3))
    moved = far.sdf(points + np.array([1e6, -1e6, 1e6]), device=device.alias)
    np.testing.assert_allclose(moved, near.sdf(points, device=device.alias), atol=1e-6)


def test_union_order_and_blend(device: wp.Device, rng: np.random.Generator) -> None:
    parts = (frustum("a", blend=0.7), frustum("b", (1.0, 0.2, 0.2)))
    points = rng.uniform(-1, 1, (200, 3))
    hard = Assembly(parts)
    each = hard.primitive_sdf(points, device=device.alias)
    np.testing.assert_allclose(hard.sdf(points, device=device.alias), each.min(axis=1), atol=1e-6)
    smooth = Assembly((parts[0], dataclasses.replace(parts[1], blend=0.3)))
    assert (smooth.sdf(points, device=device.alias) <= each.min(axis=1) + 1e-6).all()


def test_no_points_one_point_no_primitives(device: wp.Device) -> None:
    name = device.alias
    for assembly in (Assembly(), Assembly((frustum(),)), Assembly((frustum(), frustum("b")))):
        count = len(assembly.primitives)
        assert assembly.sdf([], device=name).shape == (0,)
        assert assembly.sdf(np.zeros((0, 3)), device=name).shape == (0,)
        assert assembly.primitive_sdf(np.zeros((0, 3)), device=name).shape == (0, count)
        assert assembly.sdf([[0, 0, 0]], device=name).shape == (1,)
        assert assembly.primitive_sdf([[0, 0, 0]], device=name).shape == (1, count)
    assert Assembly().sdf([[0, 0, 0]], device=name)[0] > 1e6
    with pytest.raises(InputError):
        Assembly().sdf([0, 0, 0], device=name)
    assert Assembly((frustum(),)).sdf([[1e20, 0, 0]], device=name)[0] == pytest.approx(1e20)


def test_devices_that_are_not_there() -> None:
    with pytest.raises(InputError, match="not available"):
        Assembly((frustum(),)).sdf([[0, 0, 0]], device="tpu")


def test_part_meshes_lie_on_their_surfaces(device: wp.Device) -> None:
    pose = Pose((0.2, -0.1, 0.3), (0.5, 0.5, 0.5, 0.5))
    parts = (
        frustum("plate", (0.01, 1.0, 0.8), pose),
        frustum("cone", (0.5, 0.5, 0.6), roundness=1.0, taper=0.2, dilation=0.05),
        frustum("arc", (0.2, 0.2, 1.0), roundness=1.0, bulge=0.8),
        frustum("flared", (0.5, 0.5, 0.5), taper=2.0),
        frustum("nothing", (0.0, 0.0, 0.0)),
    )
    assembly = Assembly(parts, Transform(3.0, (100.0, 0.0, 0.0)))
    meshes = assembly.part_meshes(32, device.alias)
    assert [mesh.metadata["name"] for mesh in meshes] == [part.name for part in parts]
    for index, mesh in enumerate(meshes[:4]):
        assert mesh.is_watertight and mesh.volume > 0.0
        distance = assembly.primitive_sdf(mesh.vertices, device.alias)[:, index]
        assert np.abs(distance).max() < 0.06
    np.testing.assert_allclose(meshes[0].volume, 27.0 * 0.01 * 1.0 * 0.8, rtol=0.15)
    assert meshes[3].bounds[1][0] == pytest.approx(101.5, abs=0.05)


def test_empty_meshes() -> None:
    assert len(Assembly().to_mesh(16).faces) == 0
    assert Assembly().part_meshes() == []
    for resolution in (3, 100_000):
        with pytest.raises(InputError, match="resolution"):
            Assembly().to_mesh(resolution)


@pytest.mark.parametrize("fields", [{"size": (1e30, 1, 1)}, {"dilation": 1e4}, {"pose": Pose((1e9, 0, 0))}])
def test_parts_that_no_grid_can_hold(fields: dict[str, Any]) -> None:
    assembly = Assembly((frustum("giant", **fields),))
    for mesh in (assembly.to_mesh, assembly.part_meshes):
        with pytest.raises(InputError, match='part "giant" has a length'):
            mesh(16, "cpu")


def test_to_mesh_lies_on_the_surface(device: wp.Device) -> None:
    assembly = Assembly(
        (frustum(), frustum("b", (1.0, 0.2, 0.2), blend=0.1)), Transform(0.5, (1e6, 0.0, 0.0))
    )
    mesh = assembly.to_mesh(64, device.alias)
    assert mesh.is_watertight and mesh.volume > 0.0
    assert np.abs(assembly.sdf(mesh.vertices, device.alias)).max() < 0.5 * 2.0 / 64


def test_colors() -> None:
    assert palette_color(0) == palette_color(len(PALETTE)) == PALETTE[0]
    assert len(set(PALETTE)) == len(PALETTE)
    assert rgb("#ff0080") == (1.0, 0.0, 128 / 255)
    assert linear_rgb("#ffffff") == (1.0, 1.0, 1.0)


def test_provenance(tmp_path: Path) -> None:
    path = tmp_path / "input.obj"
    path.write_bytes(b"abc")
    digest = sha256_of_file(path)
    assert digest.startswith("ba7816bf")
    first = Assembly(
        (), provenance=Provenance.current(seed=1, options={"b": 1, "a": [2]}, input_sha256=digest)
    )
    second = Assembly(
        (), provenance=Provenance.current(seed=1, options={"a": [2], "b": 1}, input_sha256=digest)
    )
    assert first.to_json() == second.to_json()
    assert first.provenance.warp and first.provenance.resfit
    with pytest.raises(InputError, match="cannot read"):
        sha256_of_file(tmp_path / "missing")


def test_bundled_lamp_is_what_saving_writes() -> None:
    content = (files("resfit.data") / "desk_lamp.json").read_bytes()
    with as_file(files("resfit.data") / "desk_lamp.json") as path:
        lamp = Assembly.load(path)
    assert lamp.to_json() == content
    assert len(lamp.primitives) == 12
    corners = np.array([mesh.bounds for mesh in lamp.part_meshes(16)]).reshape(-1, 3)
    np.testing.assert_allclose(corners.min(axis=0)[2], 0.0, atol=0.5)
    np.testing.assert_allclose(np.ptp(corners, axis=0).max(), 1.8 * lamp.transform.scale, rtol=1e-3)


def test_a_failed_save_leaves_what_was_there(tmp_path: Path) -> None:
    for wrong in (tmp_path / "missing" / "a.json", tmp_path):
        with pytest.raises(InputError, match="cannot write"):
            Assembly().save(wrong)
    path = tmp_path / "a.json"
    path.write_text("before")
    bad = Assembly((), provenance=Provenance(options={"x": float("nan")}))
    with pytest.raises(ValueError):
        bad.save(path)
    assert path.read_text() == "before"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.json"]
