"""Rows of primitives in another normalised frame than their own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.primitives import family
from ..kernels.rows import BLEND, SHAPE, SHAPES, TRANSLATION
from .transform import Transform

if TYPE_CHECKING:
    from .assembly import Assembly

SAME_FRAME = 1e-9
"""Transforms that differ by less than this share of the size are the same: files are rounded."""


def rescale_rows(
    rows: np.ndarray, families: Sequence[str], scale: float, offset: Sequence[float] | np.ndarray
) -> np.ndarray:
    """Rows in a frame where a point p of theirs is at scale * p + offset; (primitive_count, ROW) float32."""
    moved = rows.astype(np.float64)
    place = slice(TRANSLATION, TRANSLATION + 3)
    moved[:, place] = moved[:, place] * scale + np.asarray(offset, np.float64)
    moved[:, BLEND] *= scale
    shapes = moved[:, SHAPES : SHAPES + SHAPE]
    for row, name in enumerate(families):
        shapes[row, family(name).lengths] *= scale
    return moved.astype(np.float32)


def rows_in_frame(assembly: Assembly, frame: Transform) -> np.ndarray:
    """Rows (primitive_count, ROW) float32 of an assembly in another normalised frame than its own."""
    rows, own = assembly.rows(), assembly.transform
    shift = np.subtract(own.translation, frame.translation)
    if abs(own.scale / frame.scale - 1.0) < SAME_FRAME and np.abs(shift).max() < SAME_FRAME * frame.scale:
        return rows
    families = [part.family for part in assembly.primitives]
    return rescale_rows(rows, families, own.scale / frame.scale, shift / frame.scale)
