"""Quality metrics of an assembly, by the definitions that papers and peers report.

Everything is measured in the target's normalised frame. IoU, overlap and unoverlap ask the analytic fields at the
128^3 cell centres of [-1, 1]^3, never a mesh. Deviations are distances and therefore in the mesh's own units.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ...assembly.assembly import Assembly
from ...kernels.field.containment_count import count_containing
from ...kernels.field.culling import bound_blocks, cull
from ...kernels.field.evaluate import cell_centres, union_at
from ...kernels.field.points import from_grid_blocks, grid_blocks
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.primitives import FAMILIES
from ...shape.deviation import surface_distances
from ...shape.grid import distance_grid, intersection_over_union
from ...shape.target import Target
from .through_holes import filled_holes

RESOLUTION = 128
"""Cells along a side for everything that counts cells."""

POSE_FLOATS, BLEND_FLOATS, TRANSFORM_FLOATS = 7, 1, 4
"""Numbers of a pose (translation, quaternion), of a blend, and of the transform to the mesh's frame."""

PERCENTILE = 95.0
"""Of the two-sided surface distance: the largest ones are often single samples at a lost detail."""


@dataclass(frozen=True)
class Occupancy:
    """Occupancy grid of an assembly, at the cell centres of [-1, 1]^3."""

    union: np.ndarray
    """(n, n, n) bool, inside the smooth union."""
    count: np.ndarray
    """(n, n, n) uint16, primitives that hold the centre, each alone: blends set aside."""

    @property
    def overlap(self) -> float:
        """Cells inside more than one primitive over cells inside at least one; 0 where there are none."""
        return _share(self.count > 1, self.count > 0)

    @property
    def unoverlap(self) -> float:
        """Cells of the smooth union that are inside no primitive, over cells of the union; 0 where there are none."""
        return _share(self.union & (self.count == 0), self.union)


@dataclass(frozen=True)
class Deviation:
    """Two-sided distances between two surfaces, mesh units."""

    p95: float
    """95th percentile of both directions' samples together."""
    mean: float
    largest: float


def measure_occupancy(primitives: PrimitiveSet, resolution: int = RESOLUTION) -> Occupancy:
    """Evaluate the union and every primitive alone at the resolution^3 cell centres of [-1, 1]^3.

    Args:
        primitives: the assembly in the normalised frame, or whichever frame the cells are to lie in.
        resolution: cells along a side.
    """
    shape, lower, spacing = cell_centres(resolution)
    if not len(primitives):
        return Occupancy(np.zeros(shape, bool), np.zeros(shape, np.uint16))
    blocks = grid_blocks(shape, lower, spacing, primitives.device)
    bounds = bound_blocks(blocks)
    # Only the sign is asked for, which is known where the bounds are above 0.
    nowhere = wp.zeros(blocks.block_count, dtype=int, device=primitives.device)
    field = union_at(primitives, blocks, lists=cull(primitives, blocks, bounds, nowhere)).numpy()
    union = from_grid_blocks(field < 0.0, shape)
    count = from_grid_blocks(count_containing(primitives, blocks, bounds).numpy().astype(np.uint16), shape)
    return Occupancy(union, count)


def target_occupancy(target: Target) -> np.ndarray:
    """Occupancy grid of the target at the 128^3 cell centres, (128, 128, 128) bool."""
    grid = target.grid if target.resolution == RESOLUTION else distance_grid(target.query, RESOLUTION)
    return grid < 0.0


def count_floats(assembly: Assembly) -> int:
    """Numbers needed to store an assembly: poses, parameters, blends, and the transform to the mesh's frame."""
    primitives = sum(
        POSE_FLOATS + FAMILIES[primitive.family].parameter_count + BLEND_FLOATS
        for primitive in assembly.primitives
    )
    return primitives + TRANSFORM_FLOATS


def measure_cheap(assembly: Assembly, target: Target, device: str = "auto") -> dict[str, float | int]:
    """The metrics that cost little: iou, overlap, unoverlap, primitive_count, floats, filled_holes.

    Args:
        assembly: in the target's normalised frame.
        target: what it should match.
        device: `auto`, `cpu`, `cuda:0`.
    """
    occupancy, inside = measure_occupancy(assembly.on_device(device)), target_occupancy(target)
    return {
        "iou": intersection_over_union(inside, occupancy.union),
        "overlap": occupancy.overlap,
        "unoverlap": occupancy.unoverlap,
        "primitive_count": len(assembly.primitives),
        "floats": count_floats(assembly),
        "filled_holes": filled_holes(target.faces, inside, occupancy.union),
    }


def measure_deviation(assembly: Assembly, target: Target, device: str = "auto") -> Deviation | None:
    """Distances between the surfaces of an assembly and its target.

    Args:
        assembly: in the target's normalised frame.
        target: what it should match.
        device: `auto`, `cpu`, `cuda:0`.

    Returns:
        Mesh units; None where the assembly has no surface.
    """
    distance = surface_distances(target, assembly.on_device(device), RESOLUTION)
    if distance is None:
        return None
    distance = distance * target.transform.scale
    return Deviation(
        float(np.percentile(distance, PERCENTILE)), float(distance.mean()), float(distance.max())
    )


def _share(part: np.ndarray, whole: np.ndarray) -> float:
    return float(np.count_nonzero(part) / max(1, np.count_nonzero(whole)))
