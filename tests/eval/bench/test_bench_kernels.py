"""What `resfit bench kernels` and `recovery` measure, and how; not how fast anything is."""

from __future__ import annotations

import os

import numpy as np
import pytest
import warp as wp

from resfit.eval.bench.harness import Row, Workload, cores, measure, scene_points, scene_rows
from resfit.eval.bench.kernels import closed_mesh, markdown_table, messy_mesh, workloads
from resfit.eval.bench.recovery import recover
from resfit.kernels.primitives import FAMILIES
from resfit.kernels.rows import BLEND, ROTATION, SHAPES
from resfit.kernels.runtime.launch import serial_device


@pytest.mark.parametrize("name", sorted(FAMILIES))
def test_scenes_are_legal_and_the_same_everywhere(name: str) -> None:
    rows = scene_rows(name, 50)
    low, high = FAMILIES[name].legal_range
    assert (rows[:, SHAPES:BLEND] >= low).all() and (rows[:, SHAPES:BLEND] <= high).all()
    np.testing.assert_allclose(np.linalg.norm(rows[:, ROTATION : ROTATION + 4], axis=1), 1.0, atol=1e-6)
    np.testing.assert_array_equal(scene_rows(name, 50), rows)
    assert (scene_rows(name, 50, seed=1) != rows).any()


def test_points_along_the_curve_are_those_in_random_order(device: wp.Device) -> None:
    ordered, loose = (scene_points(1000, device, order) for order in ("curve", "random"))
    places = [np.stack([axis.numpy()[:1000] for axis in (p.x, p.y, p.z)], axis=1) for p in (ordered, loose)]
    np.testing.assert_array_equal(*(np.unique(points, axis=0) for points in places))
    steps = [np.linalg.norm(np.diff(points, axis=0), axis=1).mean() for points in places]
    assert steps[0] < 0.25 * steps[1]


def test_cores_are_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    for before in ("3", None):
        monkeypatch.delenv("RESFIT_THREADS", raising=False)
        if before:
            monkeypatch.setenv("RESFIT_THREADS", before)
        with pytest.raises(ZeroDivisionError), cores(1):
            assert os.environ["RESFIT_THREADS"] == "1"
            raise ZeroDivisionError
        with cores(None):
            assert os.environ.get("RESFIT_THREADS") == before
        assert os.environ.get("RESFIT_THREADS") == before


def test_a_measurement_is_medians_per_evaluation() -> None:
    calls = []
    row = measure(Workload("name", "what", 1000, lambda: calls.append(0), 3.0), serial_device())
    assert (row.name, row.what, row.evaluations, row.bound, row.bound_unit) == (
        "name",
        "what",
        1000,
        3.0,
        "ns",
    )
    # Times are rounded to 1e-4 ms and 1e-3 ns.
    assert row.ns_per_evaluation == pytest.approx(row.milliseconds * 1e3, abs=0.1)
    # Once to compile, once to see how long it takes, then several times on one core and on all.
    assert len(calls) >= 2 + 2 * 5


def test_every_workload_runs(device: wp.Device) -> None:
    names = []
    for workload in workloads(device):
        names.append(workload.name)
        assert workload.evaluations > 0 and workload.bound >= 0.0
        # The grids are a matter of half a second each.
        if "128" not in workload.name:
            workload.work()
    assert names[:2] == ["superfrustum_forward", "superfrustum_adjoint"] and len(set(names)) == len(names)
    assert {"union_dense", "union_gradient", "union_tape", "normal_equations"} <= set(names)


def test_the_table_has_a_line_for_each_row() -> None:
    rows = [Row("a", "many", 10, 1.234, 0.5, 0.25, 3.0, "ns"), Row("b", "few", 1, 2.0, 1.0, 1.0, 0.0, "ns")]
    lines = markdown_table(rows, "machine X").splitlines()
    assert "on: machine X." in lines[2]
    assert lines[-2:] == [
        "| a | many | 1.23 | 0.500 | 0.250 | 3 ns |",
        "| b | few | 2.00 | 1.000 | 1.000 |  |",
    ]


def test_the_messy_mesh_is_the_closed_one_with_holes() -> None:
    (vertices, faces), (same, fewer) = closed_mesh(), messy_mesh()
    np.testing.assert_array_equal(vertices, same)
    assert len(faces) == 40_000 and 0.93 < len(fewer) / len(faces) < 0.97
    assert np.abs(vertices).max() == np.float32(0.9)


def test_single_primitives_are_found_again(device: wp.Device) -> None:
    found = recover(6, device)
    assert len(found) == 6 and all(0.0 < iou <= 1.0 for _, iou in found)
    assert np.median([iou for _, iou in found]) > 0.9
