"""Swept solids that a region of a mesh could be, in terms that every family is told: rounded profiles.

Conventions are the SuperFrustum's: z is swept along; a positive bulge arcs towards -x, its chord, of length size z,
along z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..rows import SHAPE
from .parameters import ParameterTable

NEUTRAL = {"dilation": 0.0, "taper": 1.0, "bulge": 0.0}
"""Values at which a solid has nothing of what the term says."""
ROUND_ABOVE = 0.5
"""Roundness from which a profile is round rather than square."""


@dataclass(frozen=True)
class SweptSolids:
    """Guesses of g solids; their extents are those before dilation."""

    size: np.ndarray
    """(g, 3) full extents before dilation."""
    roundness: np.ndarray
    dilation: np.ndarray
    taper: np.ndarray
    bulge: np.ndarray
    onion: np.ndarray
    """(g,) each, as the SuperFrustum's parameters."""

    @property
    def extents(self) -> np.ndarray:
        """(g, 3) full extents, dilation included."""
        return self.size + 2.0 * self.dilation[:, None]


def box_solids(size: np.ndarray, roundness: float = 0.0) -> SweptSolids:
    """Boxes of extents (g, 3), their upright edges sharp or rounded."""
    none = np.zeros(len(size))
    return SweptSolids(size, none + roundness, none, none + 1.0, none, none - 1.0)


def shapes_by_name(
    family: ParameterTable, solids: SweptSolids, given: dict[str, np.ndarray] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Shapes whose parameters are the solids' terms of the same names, and where nothing is lost by that.

    Args:
        family: whose shapes.
        solids: g of them.
        given: values (g,) or (g, n) of other parameters, and of terms that they stand for: these lose nothing.

    Returns:
        Shapes (g, SHAPE) float32 inside the family's fit range, and (g,) bool.
    """
    given = given or {}
    near = np.ones(len(solids.size), bool)
    for name, value in NEUTRAL.items():
        if not family.has(name) and name not in given:
            near &= getattr(solids, name) == value
    if not family.has("onion"):
        near &= solids.onion <= 0.0
    if not family.has("roundness") and "roundness" not in given:
        near &= solids.roundness <= ROUND_ABOVE
    shapes = np.zeros((len(near), SHAPE), np.float32)
    for parameter in family.parameters:
        value = given.get(parameter.name, getattr(solids, parameter.name, np.array(parameter.default)))
        if parameter.name == "size" and not family.has("dilation"):
            value = solids.extents
        shapes[:, family.columns(parameter.name)] = value if value.ndim == 2 else value.reshape(-1, 1)
    low, high = family.fit_range
    return np.clip(shapes, low, high), near
