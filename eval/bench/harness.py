"""Timing of kernels: random scenes, medians of repeated work on one core and on all, and the machine's name.

One core is measured in CPU time of the launching thread, which other jobs on the machine disturb least; all cores and
GPUs in wall time.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from ...kernels.field.hilbert import curve_codes
from ...kernels.field.points import PointBlocks, point_blocks
from ...kernels.primitives import FAMILIES
from ...kernels.rows import BLEND, ROTATION, SHAPES, empty_rows
from ...kernels.runtime import launch as launching

PRIMITIVES, POINTS = 24, 20_480
"""The scene of the per-evaluation rows."""
REPETITIONS = 15


@dataclass(frozen=True)
class Row:
    """One measured kernel. Times are medians; `bound` is what one AVX-512 core should stay under, 0 for none."""

    name: str
    what: str
    evaluations: int
    ns_per_evaluation: float
    milliseconds: float
    all_cores_milliseconds: float
    bound: float
    bound_unit: str


@dataclass(frozen=True)
class Workload:
    """Something to time: `work` launches kernels and waits for nothing but them."""

    name: str
    what: str
    evaluations: int
    work: Callable[[], Any]
    bound: float = 0.0
    bound_unit: str = "ns"


def scene_rows(family: str, count: int = PRIMITIVES, seed: int = 0) -> np.ndarray:
    """Rows of `count` random primitives of mixed pose and shape: tapered, bent, hollow where the family can be."""
    rng = np.random.default_rng(seed)
    rows = empty_rows(count)
    rows[:, :3] = rng.uniform(-0.7, 0.7, (count, 3))
    turns = rng.normal(size=(count, 4))
    rows[:, ROTATION : ROTATION + 4] = turns / np.linalg.norm(turns, axis=1, keepdims=True)
    rows[:, BLEND] = 0.05
    entry = FAMILIES[family]
    low, high = entry.legal_range
    shapes = rng.uniform(low, np.minimum(high, 2.0), (count, len(low)))
    for parameter in entry.parameters:
        if parameter.typical is not None:
            shapes[:, entry.columns(parameter.name)] = rng.uniform(
                *parameter.typical, (count, parameter.count)
            )
    rows[:, SHAPES:BLEND] = shapes
    return rows


def scene_points(count: int, device: wp.Device, order: str = "curve") -> PointBlocks:
    """Random points of the cube: along the space-filling curve, as a fit keeps its own, or in `random` order."""
    points = np.random.default_rng(1).uniform(-1, 1, (count, 3))
    if order == "curve":
        points = points[np.argsort(curve_codes(points), kind="stable")]
    return point_blocks(points, device)


@contextmanager
def cores(count: int | None) -> Iterator[None]:
    """Launch on `count` cores, or on all."""
    before = os.environ.get("RESFIT_THREADS")
    if count is not None:
        os.environ["RESFIT_THREADS"] = str(count)
    try:
        yield
    finally:
        if before is not None:
            os.environ["RESFIT_THREADS"] = before
        elif count is not None:
            del os.environ["RESFIT_THREADS"]


def measure(workload: Workload, device: wp.Device) -> Row:
    """Median times after a run that compiles; work under a millisecond is repeated inside a measurement."""

    def median(clock: Callable[[], float], once: float) -> float:
        inner = max(1, min(200, round(2e-3 / max(once, 1e-7))))
        times = []
        for _ in range(REPETITIONS if once < 0.05 else 5):
            begin = clock()
            for _ in range(inner):
                workload.work()
            wp.synchronize_device(device)
            times.append((clock() - begin) / inner)
        return statistics.median(times)

    workload.work()
    wp.synchronize_device(device)
    begin = time.perf_counter()
    workload.work()
    wp.synchronize_device(device)
    once = time.perf_counter() - begin
    everything = median(time.perf_counter, once)
    seconds = everything
    if device.is_cpu:
        with cores(1):
            seconds = median(time.thread_time, once)
    return Row(
        name=workload.name,
        what=workload.what,
        evaluations=workload.evaluations,
        ns_per_evaluation=round(seconds / workload.evaluations * 1e9, 3),
        milliseconds=round(seconds * 1e3, 4),
        all_cores_milliseconds=round(everything * 1e3, 4),
        bound=workload.bound,
        bound_unit=workload.bound_unit,
    )


def cpu_model() -> str:
    """The processor's name and widest vector unit, as far as the system tells."""
    info = Path("/proc/cpuinfo")
    text = info.read_text() if info.exists() else ""
    name = next(
        (line.split(":", 1)[1].strip() for line in text.splitlines() if line.startswith("model name")), "CPU"
    )
    vectors = next((unit for unit in ("avx512f", "avx2", "asimd", "neon") if unit in text), "unknown vectors")
    return f"{name}, {vectors}, {launching.core_count()} cores"
