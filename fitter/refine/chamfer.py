"""Move the primitives of an assembly to lessen its Chamfer distance to the target; none is added or dropped.

Points drawn on the assembly's surface, where parts hidden in others have none, are paired both ways: each with the
nearest point of the target, and each of the target's samples with the nearest of them. What the pairs pull at a point
p moves the surface along its normal n only, and a change of the field moves it by -dF / |grad F|: so the derivative
of the loss to F(p) is -(pull . n) / |grad F|, from where the adjoint of the union takes it back to the primitives.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp
from scipy.spatial import KDTree

from ...kernels.contour.isosurface import extract_isosurface
from ...kernels.field.adjoint import differentiable_union
from ...kernels.field.evaluate import cell_centres, evaluate_grid
from ...kernels.field.gradient import evaluate_gradient
from ...kernels.field.points import point_blocks
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.field.raw_parameters import RAW_BLEND, RAW_DROP, RAW_KEEP
from ...kernels.mesh.mesh_query import MeshQuery
from ...kernels.rows import BLEND, GATE
from ...shape.deviation import sample_surface
from ...shape.grid import intersection_over_union
from ...shape.target import Target
from ..objective.objective import Tally
from ..objective.samples import objective_samples
from ..objective.scoring import score_values, values_at
from ..outcome import Outcome, Status
from .first_order import SMALLEST_BLEND, Moments, Unbounded

CHAMFER_SCALE = 100.0
"""Chamfer distances are given in hundredths of a squared unit, as everywhere."""

SURE = 20.0
"""Existence logit of a primitive that is there, whose gate is then 1 in float32; less a hard blend's raw number."""

STEEPEST = 10.0
"""Least and largest slope of a field that is believed, as 1 / STEEPEST and STEEPEST: creases have none."""


@dataclass(frozen=True, kw_only=True)
class ChamferConfig:
    """Options of the Chamfer refinement."""

    steps: int = 240
    rate: float = 0.01
    """Of Adam, on the unbounded numbers: positions move by as much a step at first."""
    points: int = 8192
    """Drawn on the assembly's surface, and as many of the target's samples."""
    redraw: int = 30
    """Steps between draws; in between the points follow the surface."""
    resolution: int = 96
    """Cells of the isosurface, along its longest side, that points are drawn on."""


@dataclass(frozen=True)
class ChamferMove:
    """Result of the Chamfer refinement."""

    rows: np.ndarray
    """(primitive_count, ROW) float32: the best that was measured, the start included."""
    before: float
    after: float
    """100 x the mean of the two mean squared distances, normalised units; infinity where there is no surface."""
    steps: int
    """Done before it was stopped."""


def measure_chamfer(
    target: Target, primitives: PrimitiveSet, resolution: int = 96
) -> tuple[float, np.ndarray]:
    """The Chamfer distance of an assembly, from points of either surface to the other surface itself.

    Args:
        target: what the assembly should match.
        primitives: the assembly, normalised.
        resolution: of its isosurface.

    Returns:
        100 x the mean of the two mean squared distances, infinity where the assembly has no surface; and points
        (n, 3) on the assembly.
    """
    asked = target.samples.surface.points
    vertices, faces = extract_isosurface(primitives, resolution)
    if not len(faces):
        return float("inf"), np.zeros((0, 3), np.float32)
    drawn = sample_surface(vertices, faces, len(asked))
    points = wp.array(np.ascontiguousarray(asked, np.float32), dtype=wp.vec3, device=primitives.device)
    there = MeshQuery(vertices, faces, primitives.device).closest_points(points).distance.numpy()
    back = target.query.signed_distance(drawn)
    both = np.mean(there.astype(np.float64) ** 2) + np.mean(back.astype(np.float64) ** 2)
    return float(0.5 * CHAMFER_SCALE * both), drawn


def lessen_chamfer(
    target: Target,
    rows: np.ndarray,
    families: Sequence[str],
    device: wp.Device,
    config: ChamferConfig | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    on_step: Callable[[int], None] = lambda step: None,
) -> ChamferMove:
    """Move primitives by Adam until the Chamfer distance to the target is less.

    Args:
        target: what they should match.
        rows: (primitive_count, ROW), normalised frame of the target; families may mix.
        families: their families.
        device: where to evaluate.
        config: steps, rate, points.
        should_stop: asked before each step.
        on_step: called with the number of each step.
    """
    config = config or ChamferConfig()
    best, before = rows, float("inf")
    if not len(rows):
        return ChamferMove(rows, before, before, 0)
    before, points = measure_chamfer(target, PrimitiveSet(rows, families, device), config.resolution)
    unbounded, moments = Unbounded(rows, families, device), Moments((len(rows), rows.shape[1]))
    unbounded.raw[:, RAW_KEEP], unbounded.raw[:, RAW_DROP] = SURE, -SURE
    hard = rows[:, BLEND] < SMALLEST_BLEND
    unbounded.raw[hard, RAW_BLEND] = -SURE
    least, rng, done = before, np.random.default_rng(0), 0
    for step in range(config.steps):
        if should_stop() or not len(points):
            break
        done = step + 1
        on_step(step)
        if step % config.redraw == 0:
            # In order, because fields are evaluated faster for points that lie together.
            points = points[np.sort(rng.permutation(len(points))[: config.points])]
        gradient = _gradient(target, unbounded, hard, points, rng, config)
        rate = config.rate * (0.5 + 0.5 * np.cos(np.pi * step / config.steps))
        unbounded.raw += moments.step(gradient, rate).astype(np.float32)
        if done % config.redraw and done < config.steps:
            points = _onto_surface(unbounded, points)
            continue
        moved = _plain(unbounded, hard)
        value, points = measure_chamfer(target, PrimitiveSet(moved, families, device), config.resolution)
        if value < least:
            best, least = moved, value
    return ChamferMove(best, before, least, done)


def _gradient(
    target: Target,
    unbounded: Unbounded,
    hard: np.ndarray,
    points: np.ndarray,
    rng: np.random.Generator,
    config: ChamferConfig,
) -> np.ndarray:
    """Gradient (primitive_count, ROW) of the Chamfer distance to the raw numbers; `hard` blends have none."""
    device = unbounded.primitives.device
    surface = target.samples.surface.points
    wanted = surface[rng.permutation(len(surface))[: config.points]]
    tape = wp.Tape()
    unbounded.activate(tape)
    blocks = point_blocks(points, device)
    field = differentiable_union(unbounded.primitives, blocks, tape)
    pull = _pull(target, points, wanted)
    _, slope = evaluate_gradient(unbounded.primitives, points)
    steepness = np.clip((slope**2).sum(1), STEEPEST**-2, STEEPEST**2)
    weights = np.zeros(blocks.x.shape[0], np.float32)
    weights[: blocks.count] = -(pull * slope).sum(1) / steepness
    tape.backward(grads={field: wp.array(weights, dtype=float, device=device)})
    gradient = unbounded.gradient(tape)
    gradient[:, [RAW_KEEP, RAW_DROP]] = 0.0
    gradient[hard, RAW_BLEND] = 0.0
    return gradient


def _pull(target: Target, drawn: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Derivative (n, 3) of the Chamfer distance to points of the assembly's surface (n, 3).

    `wanted` (m, 3) are points of the target's surface.
    """
    located = target.query.locate(drawn)
    away = drawn - located.nearest
    if located.on_sheet.any():
        # The surface of a sheet is half its thickness away from its faces.
        length = np.linalg.norm(away, axis=1, keepdims=True)
        thick = away * (1.0 - 0.5 * target.solid.thickness / np.maximum(length, 1e-9))
        away = np.where(located.on_sheet[:, None], thick, away)
    pull = away / len(drawn)
    _, nearest = KDTree(drawn).query(wanted)
    for axis in range(3):
        difference = drawn[nearest, axis] - wanted[:, axis]
        pull[:, axis] += np.bincount(nearest, difference, len(drawn)) / len(wanted)
    return CHAMFER_SCALE * pull


def _onto_surface(unbounded: Unbounded, points: np.ndarray) -> np.ndarray:
    """Points (n, 3) moved back onto the surface that has moved away under them, by a step along the gradient."""
    unbounded.activate(wp.Tape())
    field, slope = evaluate_gradient(unbounded.primitives, points)
    steepness = np.maximum((slope**2).sum(1), STEEPEST**-2)
    return points - np.clip(field / steepness, -0.1, 0.1)[:, None] * slope


def _plain(unbounded: Unbounded, hard: np.ndarray) -> np.ndarray:
    """Rows (primitive_count, ROW) with gates of 1 and hard blends of 0."""
    rows = unbounded.rows()
    rows[:, GATE] = 1.0
    rows[hard, BLEND] = 0.0
    return rows


def move_assembly(
    target: Target,
    rows: np.ndarray,
    families: Sequence[str],
    device: wp.Device,
    parsimony: float,
    timeout: float = 0.0,
    should_stop: Callable[[], bool] = lambda: False,
    on_share: Callable[[float], None] = lambda share: None,
) -> tuple[Outcome, ChamferMove]:
    """`lessen_chamfer` as an outcome of a fit.

    Args:
        target: what the assembly should match.
        rows: (primitive_count, ROW) of the assembly, in the target's frame.
        families: their families.
        device: where to evaluate.
        parsimony: price of a primitive in the score.
        timeout: seconds after which the best so far is returned; 0 is off.
        should_stop: asked often; once True, the best so far is returned.
        on_share: called with the share of the steps done.
    """
    begin, config = time.perf_counter(), ChamferConfig()

    def late() -> bool:
        return 0 < timeout < time.perf_counter() - begin

    moved = lessen_chamfer(
        target,
        rows,
        families,
        device,
        config,
        lambda: should_stop() or late(),
        lambda step: on_share(step / config.steps),
    )
    status = Status.MOVED
    if moved.steps < config.steps:
        status = Status.TIMEOUT if late() else Status.INTERRUPTED
    samples = objective_samples(target)
    values = values_at(moved.rows, families, point_blocks(samples.points, device), device)
    score = score_values(values, moved.rows[:, BLEND], Tally(samples), parsimony)
    held = evaluate_grid(PrimitiveSet(moved.rows, families, device), *cell_centres(target.resolution)) < 0
    iou = intersection_over_union(held, target.grid < 0)
    timings = {"chamfer": time.perf_counter() - begin}
    return Outcome(moved.rows, list(families), score, iou, status, [], timings), moved
