"""Surfaces of primitives as triangles: what is refused, which frame they are in, and how near they come."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import warp as wp

from resfit.assembly.primitive import Pose, Primitive
from resfit.assembly.surface import (
    MAX_EXTENT,
    MAX_RESOLUTION,
    check_extent,
    check_resolution,
    part_meshes,
    part_surface,
    union_mesh,
    union_surface,
)
from resfit.assembly.transform import Transform
from resfit.errors import InputError

HALF = float(np.sqrt(0.5))
PLACE = Transform(10.0, (100.0, 0.0, 0.0))


def cuboid(name: str, size: tuple[float, float, float], x: float = 0.0, turned: bool = False) -> Primitive:
    """A box at a place on the x axis, as it is or by a quarter turn about z."""
    rotation = (HALF, 0.0, 0.0, HALF) if turned else (1.0, 0.0, 0.0, 0.0)
    return Primitive("cuboid", name, Pose((x, 0.0, 0.0), rotation), {"size": size})


@pytest.mark.parametrize("resolution", [3, MAX_RESOLUTION + 1])
def test_resolutions_that_no_grid_has(resolution: int) -> None:
    with pytest.raises(InputError, match=rf"resolution is {resolution}; it must lie in \[4, 512\]"):
        check_resolution(resolution)
    check_resolution(4)
    check_resolution(MAX_RESOLUTION)


def test_parts_that_no_grid_holds_are_named() -> None:
    check_extent(cuboid("near", (1.0, 1.0, MAX_EXTENT)))
    with pytest.raises(InputError, match=r"part .*far.* has a length or coordinate of 2000"):
        check_extent(cuboid("far", (1.0, 1.0, 1.0), x=2e3))


def test_a_part_is_in_its_own_frame(device: wp.Device) -> None:
    size = (0.8, 0.4, 0.2)
    vertices, faces = part_surface(cuboid("a", size, x=0.7, turned=True), 32, device.alias)
    assert vertices.dtype == np.float64 and faces.dtype == np.int64
    np.testing.assert_allclose(np.ptp(vertices, axis=0), size, atol=1e-5)
    np.testing.assert_allclose(vertices.mean(axis=0), 0.0, atol=0.02)


def test_parts_and_union_are_placed(device: wp.Device) -> None:
    parts = [cuboid("a", (0.8, 0.4, 0.2), turned=True), cuboid("b", (0.2, 0.2, 0.2), x=0.6)]
    first, second = part_meshes(parts, PLACE, 32, device.alias)
    assert (first.metadata["name"], second.metadata["name"]) == ("a", "b")
    # Turned about z, its longest side is along y; ten times as large, and shifted.
    np.testing.assert_allclose(first.bounds, [[98.0, -4.0, -1.0], [102.0, 4.0, 1.0]], atol=1e-3)
    np.testing.assert_allclose(second.bounds, [[105.0, -1.0, -1.0], [107.0, 1.0, 1.0]], atol=1e-3)
    assert first.is_watertight and first.volume == pytest.approx(64.0, rel=1e-3)
    union = union_mesh(parts, PLACE, 64, device.alias)
    assert union.volume == pytest.approx(64.0 + 8.0, rel=0.02)
    assert len(union.split()) == 2


def test_the_union_is_one_surface(device: wp.Device) -> None:
    """Of two boxes that overlap by a half, what lies within is left out."""
    parts = [cuboid("a", (0.4, 0.4, 0.4)), cuboid("b", (0.4, 0.4, 0.4), x=0.2)]
    vertices, faces = union_surface(parts, 64, device.alias)
    mesh = trimesh.Trimesh(vertices, faces)
    assert mesh.is_watertight and mesh.volume == pytest.approx(0.6 * 0.4 * 0.4, rel=0.02)
    assert union_surface([], 64)[0].shape == (0, 3) and len(union_mesh([], PLACE, 64).faces) == 0
