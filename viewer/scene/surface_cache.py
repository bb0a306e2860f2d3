"""Surfaces that follow edits: each part alone, kept by the numbers that shape it, and the smooth union.

Moving, turning, hiding or recolouring a part changes no surface of it: only an edit of its shape makes a new one, of
that part alone.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np

from ...assembly.assembly import Assembly
from ...assembly.colors import rgb
from ...assembly.primitive import Primitive
from ...assembly.surface import Surface, part_surface, union_surface
from ...kernels.field.combine import combined, combined_share
from ...kernels.field.evaluate import evaluate_primitives

LIVE_CELLS, PART_CELLS = 16, 24
"""Cells along a part's longest side, while it is dragged and at rest: 16 take a few milliseconds."""

LIVE_UNION_CELLS, UNION_SHARE = 48, 4
"""The same for the longest side of a union: while a blend is dragged, and at rest by the cells of a part."""

CAPACITY = 512
"""Surfaces kept, 0.2 MB each: a drag of a slider makes hundreds."""


def shape_key(part: Primitive, cells: int) -> Hashable:
    """Cache key of the surface of a part in its own frame."""
    return part.family, tuple(part.parameters.items()), cells


class PartSurfaces:
    """Surfaces of single parts in their local frames, the latest CAPACITY of them.

    Attributes:
        made: how many surfaces were computed so far, for those who measure.
    """

    def __init__(self, device: str = "auto") -> None:
        """Compute on `auto`, `cpu` or `cuda:0`."""
        self.device = device
        self.made = 0
        self._kept: OrderedDict[Hashable, Surface] = OrderedDict()

    def has(self, part: Primitive, cells: int) -> bool:
        """Cache hit: True if a surface is there without any work."""
        return shape_key(part, cells) in self._kept

    def surface(self, part: Primitive, cells: int = PART_CELLS) -> Surface:
        """Vertices (v, 3) and faces (f, 3) of a part, local frame, sharp edges kept.

        Raises:
            InputError: if the part is too large for a grid.
        """
        key = shape_key(part, cells)
        if key not in self._kept:
            self._kept[key] = part_surface(part, cells, self.device)
            self.made += 1
            if len(self._kept) > CAPACITY:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key]


@dataclass(frozen=True)
class JoinedSurface:
    """The smooth union of an assembly, normalised frame."""

    vertices: np.ndarray
    """(v, 3) float64."""
    faces: np.ndarray
    """(f, 3) int64."""
    colors: np.ndarray
    """(v, 3) uint8, sRGB; they run into each other where the parts do."""
    owners: np.ndarray
    """(f,) int, index of the part that is nearest."""


def joined_surface(
    assembly: Assembly, cells: int = UNION_SHARE * PART_CELLS, device: str = "auto"
) -> JoinedSurface:
    """The surface of the smooth union, in the colours of its parts.

    Args:
        assembly: what to mesh.
        cells: along the longest side of its box.
        device: `auto`, `cpu`, `cuda:0`.

    Raises:
        InputError: if a part is too large for a grid.
    """
    vertices, faces = union_surface(assembly.primitives, cells, device)
    if not len(vertices):
        return JoinedSurface(vertices, faces, np.zeros((0, 3), np.uint8), np.zeros(0, np.int64))
    values = evaluate_primitives(assembly.on_device(device), vertices.astype(np.float32))
    centres = vertices[faces].mean(axis=1).astype(np.float32)
    owners = evaluate_primitives(assembly.on_device(device), centres).argmin(axis=0)
    return JoinedSurface(vertices, faces, blended_colors(assembly, values), owners)


def blended_colors(assembly: Assembly, values: np.ndarray) -> np.ndarray:
    """Colours (n, 3) uint8 of points, folded as the union folds the parts' distances (K, n)."""
    field, color = (
        values[0].astype(np.float64),
        np.tile(rgb(assembly.primitives[0].color), (values.shape[1], 1)),
    )
    for part, value in zip(assembly.primitives[1:], values[1:], strict=True):
        share = 1.0 - combined_share(field, value, part.blend)
        color += share[:, None] * (np.asarray(rgb(part.color)) - color)
        field = combined(field, value, part.blend)
    return np.round(255.0 * color).astype(np.uint8)
