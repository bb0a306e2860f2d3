"""`resfit bench recovery`: can a single SuperFrustum be found again from nothing but its voxel grid?

A fixed set of random primitives (tapered, bent, hollow, rings, and all at once), each sampled on a 96^3 grid and
fitted by the same batched proposals that a fit uses.
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np
import warp as wp

from ...decomposition.region import Region
from ...fitter.presets import ProposeConfig
from ...fitter.propose.candidates import fit_regions
from ...kernels.field.evaluate import cell_centres, union_at
from ...kernels.field.points import from_grid_blocks, grid_blocks
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.rows import ROTATION, SHAPES, empty_rows
from ...kernels.runtime import launch as launching
from ...shape.grid import intersection_over_union

RESOLUTION = 96
KINDS = ("tapered", "bent", "hollow", "ring", "mixed")
SMALLEST = 400
"""Cells that a primitive of the set fills at least."""


def _random_primitive(kind: str, rng: np.random.Generator) -> np.ndarray:
    """One row of the given kind, about the middle of [-1, 1]^3, walls of three cells or more."""
    rows = empty_rows(1)
    turn = rng.normal(size=4)
    rows[0, :3] = rng.uniform(-0.15, 0.15, 3)
    rows[0, ROTATION : ROTATION + 4] = turn / np.linalg.norm(turn)
    size = rng.uniform(0.25, 0.9, 3)
    roundness, dilation = rng.uniform(), rng.uniform(0.0, 0.08)
    taper = rng.uniform(0.2, 1.8) if kind in ("tapered", "mixed") else 1.0
    bulge = rng.choice([-1, 1]) * rng.uniform(0.15, 0.95) if kind in ("bent", "mixed") else 0.0
    onion = -1.0
    if kind in ("bent", "mixed"):
        size *= [0.5, 0.7, 1.3]
    if kind == "hollow" or (kind == "mixed" and rng.uniform() < 0.5):
        size[:2] = rng.uniform(0.5, 0.9, 2)
        onion = rng.uniform(0.3, 0.7)
        dilation = rng.uniform(0.0, 0.03)
    if kind == "ring":
        size = np.array([*rng.uniform(0.6, 1.1, 2), rng.uniform(0.0, 0.1)])
        roundness, onion, dilation = rng.uniform(0.3, 1.0), rng.uniform(0.8, 0.97), rng.uniform(0.06, 0.12)
    rows[0, SHAPES : SHAPES + 8] = [*size, roundness, dilation, taper, bulge, onion]
    return rows


def _grid_of(rows: np.ndarray, device: wp.Device) -> np.ndarray:
    """Signed distances (RESOLUTION,) * 3 of a row at the cell centres of [-1, 1]^3."""
    shape, lower, spacing = cell_centres(RESOLUTION)
    field = union_at(PrimitiveSet(rows, ["superfrustum"], device), grid_blocks(shape, lower, spacing, device))
    return from_grid_blocks(field.numpy(), shape)


def _whole_region(grid: np.ndarray) -> Region:
    """All inside cells as one region."""
    inside = grid < 0
    index = np.argwhere(inside)
    low, high = index.min(0), index.max(0) + 1
    mask = inside[low[0] : high[0], low[1] : high[1], low[2] : high[2]]
    return Region(lower=low, mask=mask, resolution=grid.shape[0], source="solid")


def recover(count: int, device: wp.Device, seed: int = 0) -> list[tuple[str, float]]:
    """Kind and IoU of each primitive of the set after the fit."""
    rng = np.random.default_rng(seed)
    results = []
    while len(results) < count:
        kind = KINDS[len(results) % len(KINDS)]
        grid = _grid_of(_random_primitive(kind, rng), device)
        if (grid < 0).sum() < SMALLEST:
            continue
        candidates = fit_regions([_whole_region(grid)], grid, "superfrustum", ProposeConfig(), seed, device)
        found = _grid_of(candidates.rows[:1], device) < 0
        results.append((kind, intersection_over_union(found, grid < 0)))
    return results


def run_recovery(device: str = "auto", as_json: bool = False, count: int = 200) -> int:
    """Recover the set and print the mean IoU and the share above 0.98, by kind and in all."""
    chosen = launching.choose_device(device)
    begin = time.perf_counter()
    results = recover(count, chosen)
    seconds = time.perf_counter() - begin
    report = {"count": count, "seconds_each": round(seconds / count, 4)}
    for kind in (*KINDS, "all"):
        ious = np.array([iou for name, iou in results if kind in (name, "all")])
        report[kind] = {
            "mean_iou": round(float(ious.mean()), 4),
            "worst": round(float(ious.min()), 4),
            "above_098": round(float((ious > 0.98).mean()), 4),
        }
    if as_json:
        sys.stdout.write(json.dumps(report, indent=1) + "\n")
        return 0
    sys.stdout.write(
        f"{count} random SuperFrusta from their {RESOLUTION}^3 grids, {report['seconds_each']} s each\n"
    )
    for kind in (*KINDS, "all"):
        row = report[kind]
        sys.stdout.write(
            f"{kind:8s} mean IoU {row['mean_iou']:.4f}  worst {row['worst']:.4f}  above 0.98: {row['above_098']:.0%}\n"
        )
    return 0
