"""Points where the primitives themselves are, but the target is not.

The objective's samples lie near the target and, sparsely, in its box: a thin part that sticks out far hits few of
them and would hardly be pulled back. Probes are drawn inside each primitive and kept where the target is far, so that
refinement sees that volume as clearly as what lies near the surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import warp as wp

from ...kernels.field.points import point_blocks
from ...kernels.primitives import family
from ...kernels.rows import ROTATION, SHAPE, SHAPES
from ...shape.target import Target
from .objective import ObjectiveSamples
from .scoring import values_at

DRAWS = 256
"""Points drawn in each primitive's box."""

FAR = 0.03
"""Distance from the target, normalised units, from which the samples near its surface see nothing any more."""

DENSITY = 60_000.0
"""Weight of a unit of volume: about that of the samples near the surface."""

HEAVIEST = 4.0
"""Most weight of one probe."""


def with_outside_samples(
    samples: ObjectiveSamples,
    rows: np.ndarray,
    families: Sequence[str],
    target: Target,
    seed: int,
    device: wp.Device,
) -> ObjectiveSamples:
    """The samples and, after them, the probes of an assembly.

    Args:
        samples: of the target.
        rows: (primitive_count, ROW).
        families: their families.
        target: what to match.
        seed: of the draw.
        device: where to evaluate.
    """
    if not len(rows):
        return samples
    points, volumes = _draw(rows, families, np.random.default_rng(seed))
    owner = np.repeat(np.arange(len(rows)), DRAWS)
    own = values_at(rows, families, point_blocks(points, device), device)[owner, np.arange(len(points))]
    cells = np.floor((points + 1.0) * (0.5 * target.resolution)).astype(int)
    within = ((cells >= 0) & (cells < target.resolution)).all(1)
    cells = np.clip(cells, 0, target.resolution - 1)
    outside = ~within | (target.grid[tuple(cells.T)] > FAR)
    kept = np.flatnonzero((own < 0) & outside)
    if not len(kept):
        return samples
    weight = np.minimum(volumes[owner[kept]] * (DENSITY / DRAWS), HEAVIEST)
    return replace(
        samples,
        points=np.concatenate([samples.points, points[kept]]),
        distance=np.concatenate(
            [samples.distance, target.query.signed_distance(points[kept]).astype(np.float32)]
        ),
        weight=np.concatenate([samples.weight, weight.astype(np.float32)]),
    )


def _draw(
    rows: np.ndarray, families: Sequence[str], rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """DRAWS points in the box of each primitive, (primitive_count * DRAWS, 3) float32, and the boxes' volumes."""
    bounds = [
        family(name).bounds(row[SHAPES : SHAPES + SHAPE]) for name, row in zip(families, rows, strict=True)
    ]
    low, high = (np.stack([pair[side] for pair in bounds]) for side in range(2))
    local = low[:, None] + (high - low)[:, None] * rng.uniform(size=(len(rows), DRAWS, 3))
    turn = rows[:, ROTATION : ROTATION + 4].astype(np.float64)
    w, axis = turn[:, None, :1], turn[:, None, 1:]
    # v + 2 w (a x v) + 2 a x (a x v)
    crossed = np.cross(axis, local)
    world = local + 2.0 * (w * crossed + np.cross(axis, crossed)) + rows[:, None, :3]
    return world.reshape(-1, 3).astype(np.float32), (high - low).prod(1)
