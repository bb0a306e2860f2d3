"""Polygons given by the indices of their corners, checked and cut into triangles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from .polygons import triangulate


def check_held(where: str, says: int, held: int, what: tuple[str, str]) -> None:
    """Refuse a file that holds less than it says.

    Args:
        where: what messages call the file.
        says, held: the number that it should hold, and that it does hold.
        what: the word for one and for several.

    Raises:
        InputError: if it holds less.
    """
    if held < says:
        raise InputError(
            f"{where} says {says} {what[says != 1]} but holds {held}; the file ends in the middle, export or"
            " download it again."
        )


@dataclass(frozen=True)
class Cut:
    """Polygons as triangles."""

    faces: npt.NDArray[np.int64]
    """(m, 3) indices of vertices."""
    owners: npt.NDArray[np.int64]
    """(m,) the polygon of each, ascending."""
    points: int
    """Polygons with one corner."""
    lines: int
    """Polygons with two corners."""


def cut_polygons(
    vertices: npt.NDArray[np.float64],
    corners: npt.NDArray[np.int64],
    counts: npt.NDArray[np.int64],
    where: Callable[[int], str],
) -> Cut:
    """Polygons of a file as triangles.

    Args:
        vertices: (n, 3).
        corners: (sum of counts,) indices of vertices from 0 on, polygon after polygon.
        counts: (p,) corners of each polygon.
        where: what messages call a polygon of the file, for instance a line.

    Raises:
        InputError: if a corner is not there.
    """
    outside = (corners < 0) | (corners >= len(vertices))
    if outside.any():
        first = int(np.argmax(outside))
        polygon = int(np.searchsorted(np.cumsum(counts), first, side="right"))
        raise InputError(
            f"{where(polygon)} names a vertex that is not among the file's {len(vertices)}; the file is damaged,"
            " export it again."
        )
    # Coordinates that are no numbers are refused where all formats are; here they may be compared.
    with np.errstate(all="ignore"):
        faces, owners = triangulate(vertices, corners, counts)
    return Cut(faces, owners, int(np.count_nonzero(counts == 1)), int(np.count_nonzero(counts == 2)))
