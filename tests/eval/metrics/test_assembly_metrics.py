"""Metrics against answers that are known: boxes and spheres."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import warp as wp

from resfit.assembly.assembly import Assembly
from resfit.assembly.primitive import Pose, Primitive
from resfit.eval.metrics.assembly_metrics import (
    count_floats,
    measure_cheap,
    measure_deviation,
    measure_occupancy,
)
from resfit.shape.deviation import sample_surface
from resfit.shape.grid import intersection_over_union
from resfit.shape.target import Target, make_target


def box(name: str, x: float, size: tuple[float, float, float], blend: float = 0.0) -> Primitive:
    return Primitive("cuboid", name, Pose((x, 0.0, 0.0)), {"size": size}, blend)


def ball(radius: float) -> Primitive:
    # A superfrustum that is nothing but its dilation.
    return Primitive(
        "superfrustum",
        "ball",
        Pose(),
        {
            "size": (1e-3, 1e-3, 1e-3), "roundness": 0.0, "dilation": radius, "taper": 1.0, "bulge": 0.0, "onion": -1.0,
        },
    )  # fmt: skip


@pytest.fixture(scope="module")
def box_target() -> Target:
    """The box of half sides 0.9, 0.45, 0.45 in the normalised frame; ten times that in mesh units."""
    from resfit.kernels.runtime.launch import choose_device

    mesh = trimesh.creation.box((18.0, 9.0, 9.0))
    mesh.apply_translation((100.0, 0.0, 0.0))
    return make_target(mesh, choose_device("cpu"), sample_count=2000)


def test_iou_of_boolean_arrays() -> None:
    a, b = np.array([True, True, False, False]), np.array([True, False, True, False])
    assert intersection_over_union(a, b) == pytest.approx(1 / 3)
    assert intersection_over_union(a, a) == 1.0
    assert intersection_over_union(a & False, a & False) == 0.0


def test_overlap_of_two_boxes(device: wp.Device) -> None:
    # Each is 64 cells long, and 32 of them are common.
    assembly = Assembly((box("a", -0.25, (1.0, 1.0, 1.0)), box("b", 0.25, (1.0, 1.0, 1.0))))
    occupancy = measure_occupancy(assembly.on_device(device.alias))
    assert occupancy.union.sum() == 96 * 64 * 64
    assert occupancy.overlap == pytest.approx(32 / 96)
    assert occupancy.unoverlap == 0.0
    assert occupancy.count.max() == 2


def test_cells_of_any_resolution(device: wp.Device) -> None:
    assembly = Assembly((box("a", 0.0, (1.0, 1.0, 1.0)),))
    assert measure_occupancy(assembly.on_device(device.alias), 20).union.sum() == 10**3


def test_unoverlap_is_what_only_the_blend_fills(device: wp.Device) -> None:
    apart = (box("a", -0.3, (0.5, 1.0, 1.0)), box("b", 0.3, (0.5, 1.0, 1.0), blend=0.4))
    smooth = measure_occupancy(Assembly(apart).on_device(device.alias))
    alone = smooth.count > 0
    assert smooth.overlap == 0.0
    assert smooth.unoverlap == pytest.approx((smooth.union & ~alone).sum() / smooth.union.sum())
    assert smooth.unoverlap > 0.05
    hard = measure_occupancy(Assembly((apart[0], box("b", 0.3, (0.5, 1.0, 1.0)))).on_device(device.alias))
    assert hard.unoverlap == 0.0


def test_ball_in_a_box_has_the_volumes_ratio(box_target: Target, device: wp.Device) -> None:
    assembly = Assembly((ball(0.45),), box_target.transform)
    metrics = measure_cheap(assembly, box_target, device.alias)
    # Cell centres lie at odd multiples of 1/128: 116 of them are within 0.9 of the middle, 58 within 0.45.
    cells = 4 / 3 * np.pi * (64 * 0.4505) ** 3 / (116 * 58 * 58)
    assert metrics["iou"] == pytest.approx(cells, rel=0.005)
    assert metrics["primitive_count"] == 1
    assert metrics["overlap"] == metrics["unoverlap"] == 0.0


def test_perfect_fit(box_target: Target, device: wp.Device) -> None:
    assembly = Assembly((box("a", 0.0, (1.8, 0.9, 0.9)),), box_target.transform)
    assert measure_cheap(assembly, box_target, device.alias)["iou"] == 1.0
    deviation = measure_deviation(assembly, box_target, device.alias)
    assert deviation is not None and deviation.largest < 1e-3 * box_target.transform.scale


def test_deviation_is_in_mesh_units_and_two_sided(box_target: Target, device: wp.Device) -> None:
    # Half of the target is missing: its far end is one half length (9 units) away, the rest fits.
    half = Assembly((box("a", -0.45, (0.9, 0.9, 0.9)),), box_target.transform)
    deviation = measure_deviation(half, box_target, device.alias)
    assert deviation is not None
    assert 7.0 < deviation.p95 < 9.0
    assert deviation.largest == pytest.approx(9.0, abs=0.3)
    # The other way round: a box that is too long by 0.2 on each side, 2 mesh units.
    long = Assembly((box("a", 0.0, (2.2, 0.9, 0.9)),), box_target.transform)
    deviation = measure_deviation(long, box_target, device.alias)
    assert deviation is not None and deviation.largest == pytest.approx(2.0, abs=0.05)


def test_empty_assembly(box_target: Target, device: wp.Device) -> None:
    empty = Assembly((), box_target.transform)
    metrics = measure_cheap(empty, box_target, device.alias)
    assert (metrics["iou"], metrics["overlap"], metrics["unoverlap"], metrics["primitive_count"]) == (
        0,
        0,
        0,
        0,
    )
    assert measure_deviation(empty, box_target, device.alias) is None


def test_floats_of_24_superfrusta_are_about_400() -> None:
    parts = tuple(
        Primitive("superfrustum", f"part_{index}", Pose(), dict(ball(0.1).parameters)) for index in range(24)
    )
    assert count_floats(Assembly(parts)) == 24 * (7 + 8 + 1) + 4


def test_surface_samples_are_spread_by_area() -> None:
    mesh = trimesh.creation.box((1.0, 1.0, 3.0))
    points = sample_surface(np.asarray(mesh.vertices), np.asarray(mesh.faces), 7000)
    assert np.abs(np.abs(points) / (0.5, 0.5, 1.5)).max(axis=1) == pytest.approx(1.0, abs=1e-6)
    ends = np.abs(points[:, 2]) > 1.4999
    assert ends.mean() == pytest.approx(2 / 14, abs=0.01)
