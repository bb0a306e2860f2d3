"""`resfit bench kernels`: what an evaluation costs on this machine, on one core and on all.

Workloads are made here, from fixed seeds, so that two machines measure the same thing.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np
import trimesh
import warp as wp

from ...kernels.field.adjoint import differentiable_assembly, differentiable_union
from ...kernels.field.culling import cull, every_primitive
from ...kernels.field.evaluate import cell_centres, primitives_at, union_at
from ...kernels.field.gradient import union_gradient_at
from ...kernels.field.points import grid_blocks
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.grid.distance_grid import signed_distance_transform
from ...kernels.mesh.mesh_grid import signed_distance_grid
from ...kernels.mesh.mesh_query import MeshQuery
from ...kernels.primitives import DEFAULT_FAMILY, FAMILIES
from ...kernels.refine.normal_equations import SYSTEM, normal_equations_at
from ...kernels.refine.point_batches import point_batches
from ...kernels.runtime import launch as launching
from ...kernels.runtime import module_loading
from .fit_kernels import measure_shares, shares_table
from .harness import POINTS, PRIMITIVES, Row, Workload, cpu_model, measure, scene_points, scene_rows
from .scaling import measure_peak, measure_scaling, scaling_table
from .workload import measure_steps, say_row, workload_table


def family_workloads(device: wp.Device) -> Iterator[Workload]:
    """Each family forward, and backward: all derivatives at every point, weighted and summed."""
    points = scene_points(POINTS, device, "random")
    scene = f"{PRIMITIVES} primitives x {POINTS} points"
    values = wp.empty(PRIMITIVES * POINTS, dtype=float, device=device)
    ones = wp.ones(PRIMITIVES * POINTS, dtype=float, device=device)
    for name in sorted(FAMILIES, key=lambda name: name != DEFAULT_FAMILY):
        primitives = PrimitiveSet(scene_rows(name), [name] * PRIMITIVES, device, requires_grad=True)
        tape = wp.Tape()
        _, asked = differentiable_assembly(primitives, points, tape)
        bounds = (3.0, 10.0) if name == DEFAULT_FAMILY else (0.0, 0.0)
        kind = "approximate distance" if FAMILIES[name].approximate else "distance"

        def forward(primitives: PrimitiveSet = primitives) -> None:
            primitives_at(primitives, points, values)

        def adjoint(tape: wp.Tape = tape, asked: wp.array = asked) -> None:
            tape.backward(grads={asked: ones})

        yield Workload(f"{name}_forward", f"{kind}, {scene}", PRIMITIVES * POINTS, forward, bounds[0])
        yield Workload(
            f"{name}_adjoint",
            f"{kind}, backward step: all derivatives, weighted and summed, {scene}",
            PRIMITIVES * POINTS,
            adjoint,
            bounds[1],
        )


def _union_workloads(device: wp.Device) -> Iterator[Workload]:
    """The smooth union of 24 SuperFrusta in its forms; an evaluation is a point."""
    families = [DEFAULT_FAMILY] * PRIMITIVES
    primitives = PrimitiveSet(scene_rows(DEFAULT_FAMILY), families, device, requires_grad=True)
    points = scene_points(POINTS, device, "random")
    lists = every_primitive(primitives, points)
    field = wp.empty(POINTS, dtype=float, device=device)
    scene = f"{PRIMITIVES} primitives, {POINTS} points"
    yield Workload(
        "union_dense",
        f"smooth union, {scene}",
        POINTS,
        lambda: union_at(primitives, points, lists=lists, out_field=field),
        80.0,
    )
    yield Workload(
        "union_gradient",
        f"smooth union and its gradient in space, {scene}",
        POINTS,
        lambda: union_gradient_at(primitives, points, lists=lists),
    )

    ones = wp.ones(POINTS, dtype=float, device=device)

    def tape_step() -> None:
        tape = wp.Tape()
        out = differentiable_union(primitives, points, tape)
        tape.backward(grads={out: ones})

    yield Workload(
        "union_tape", f"smooth union forward and backward through wp.Tape, {scene}", POINTS, tape_step
    )
    shape, lower, spacing = cell_centres(128)
    grid = grid_blocks(shape, lower, spacing, device)
    grid_field = wp.empty(grid.x.shape[0], dtype=float, device=device)
    yield Workload(
        "union_grid_128",
        f"smooth union of {PRIMITIVES} primitives on 128^3 cell centres, culled",
        grid.count,
        lambda: union_at(primitives, grid, lists=cull(primitives, grid), out_field=grid_field),
    )


def _normal_equations_workload(device: wp.Device) -> Workload:
    """Systems of 20 primitives over 24k points, each point with one owner."""
    rng = np.random.default_rng(2)
    count, primitive_count = 24_000, 20
    primitives = PrimitiveSet(
        scene_rows(DEFAULT_FAMILY, primitive_count), [DEFAULT_FAMILY] * primitive_count, device
    )
    owned = point_batches(
        rng.uniform(-1, 1, (count, 3)),
        rng.integers(0, primitive_count, count),
        primitive_count,
        rng.uniform(-0.1, 0.1, count),
        device=device,
    )
    partial = wp.zeros(owned.pair_count * SYSTEM**2, dtype=float, device=device)
    systems = wp.zeros(primitive_count * SYSTEM**2, dtype=float, device=device)
    betas = wp.full(primitive_count, 30.0, dtype=float, device=device)
    return Workload(
        "normal_equations",
        f"{primitive_count} systems of 15 x 15 over {count} points",
        count,
        lambda: normal_equations_at(primitives, owned, betas, partial, systems),
        0.5,
        "ms",
    )


def closed_mesh() -> tuple[np.ndarray, np.ndarray]:
    """A closed torus with waves, 40,000 faces, in the normalised frame."""
    mesh = trimesh.creation.torus(0.62, 0.25, major_sections=200, minor_sections=100)
    around = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0])
    vertices = mesh.vertices * (1 + 0.03 * np.sin(9 * around))[:, None]
    return (vertices / np.abs(vertices).max() * 0.9).astype(np.float32), mesh.faces.astype(np.int32)


def messy_mesh() -> tuple[np.ndarray, np.ndarray]:
    """The same with a twentieth of its faces missing, so that only winding numbers tell inside from outside."""
    vertices, faces = closed_mesh()
    return vertices, faces[np.random.default_rng(3).uniform(size=len(faces)) > 0.05]


def _grid_workloads(device: wp.Device) -> Iterator[Workload]:
    """Distance transform and mesh distance on 128^3 cell centres; an evaluation is a cell."""
    cells = 128**3
    query = MeshQuery(*closed_mesh(), device)
    inside = wp.array(signed_distance_grid(query, 128).distance.numpy() < 0, dtype=wp.bool, device=device)
    yield Workload(
        "distance_transform_128",
        "exact Euclidean transform of 128^3, both sides",
        cells,
        lambda: signed_distance_transform(inside),
        100.0,
        "ms",
    )
    for name, mesh, bound in (("closed", closed_mesh(), 500.0), ("messy", messy_mesh(), 1200.0)):
        yield Workload(
            f"mesh_distance_128_{name}",
            f"signed distance of a {name} mesh of {len(mesh[1])} faces on 128^3, tree included",
            cells,
            lambda mesh=mesh: signed_distance_grid(MeshQuery(*mesh, device), 128),
            bound,
            "ms",
        )


def workloads(device: wp.Device) -> Iterator[Workload]:
    """Everything that is measured, made one after the other."""
    yield from family_workloads(device)
    yield from _union_workloads(device)
    yield _normal_equations_workload(device)
    yield from _grid_workloads(device)


def markdown_table(rows: list[Row], machine: str) -> str:
    """The rows as a Markdown page."""
    lines = [
        "# Kernel speed",
        "",
        f"Written by `resfit bench kernels --markdown docs/kernels.md` on: {machine}.",
        "Medians; one core in CPU time, all cores in wall time. Bounds are for one core with AVX-512 (without: x 2.5).",
        "",
        "| kernel | work | ns an evaluation, one core | ms, one core | ms, all cores | bound |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        bound = f"{row.bound:g} {row.bound_unit}" if row.bound else ""
        lines.append(
            f"| {row.name} | {row.what} | {row.ns_per_evaluation:.2f} | {row.milliseconds:.3f} "
            f"| {row.all_cores_milliseconds:.3f} | {bound} |"
        )
    return "\n".join(lines) + "\n"


def run_kernels(device: str = "auto", as_json: bool = False, markdown: Path | None = None) -> int:
    """Measure all kernels and the published workload, and print the tables, or JSON; optionally write the page.

    Returns:
        0. Bounds are shown, not enforced: a machine may simply be slower.
    """
    chosen = launching.choose_device(device)
    machine = cpu_model() if chosen.is_cpu else chosen.name
    rows = []
    for workload in workloads(chosen):
        rows.append(measure(workload, chosen))
        if not as_json:
            sys.stderr.write(
                f"{rows[-1].name}: {rows[-1].ns_per_evaluation:.2f} ns, {rows[-1].milliseconds:.3f} ms\n"
            )
    published = measure_steps(chosen, on_row=None if as_json else say_row)
    peak = measure_peak(
        chosen, next(row.ns_per_evaluation for row in rows if row.name == f"{DEFAULT_FAMILY}_forward")
    )
    growth, shares = measure_scaling(chosen), measure_shares(chosen)
    page = markdown_table(rows, machine) + shares_table(shares) + scaling_table(growth, peak)
    page += workload_table(published)
    if markdown is not None:
        markdown.write_text(page)
    if as_json:
        document = {
            "device": chosen.alias,
            "machine": machine,
            "compile_seconds": round(module_loading.compile_seconds, 2),
            "rows": [asdict(row) for row in rows],
            "fit": [asdict(row) for row in shares],
            "growth": [asdict(row) for row in growth],
            "peak": asdict(peak) | {"share": peak.share},
            "published_workload": [asdict(row) for row in published],
        }
        sys.stdout.write(json.dumps(document, indent=1) + "\n")
    else:
        sys.stdout.write(page)
    return 0
