"""A plane through an assembly as a picture: the cut face in the parts' colours, or signed distances as bands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...assembly.assembly import Assembly
from ...kernels.field.evaluate import evaluate_assembly, evaluate_primitives
from .surface_cache import blended_colors

PIXELS = 256
"""Along the longer side of a plane's picture; 48 while something is dragged would show steps."""

BANDS = 12
"""Isolines of distance across the longer side of the plane."""

INSIDE, OUTSIDE = (0.23, 0.44, 0.66), (0.88, 0.47, 0.04)
"""Colours of negative and positive distances, those of the viewer's sliders and of what is selected."""


@dataclass(frozen=True)
class PlanePicture:
    """A picture and where it lies."""

    image: np.ndarray
    """(rows, columns, 4) uint8 RGBA; row 0 lies at `low` of the second axis, column 0 at that of the first."""
    axes: tuple[int, int]
    """The axes of its columns and rows."""
    low: np.ndarray
    high: np.ndarray
    """Corners (3,), in the assembly's normalised frame; equal along the plane's own axis."""


def cut_face(assembly: Assembly, axis: int, at: float, box: tuple[np.ndarray, np.ndarray]) -> PlanePicture:
    """Cross-section of the solid with a plane, in the colours of the parts; clear elsewhere.

    Args:
        assembly: what is cut, with at least one part.
        axis: across which the plane lies.
        at: its coordinate, normalised frame.
        box: corners (3,) of what the picture should hold, normalised frame.
    """
    points, place = _plane(axis, at, box)
    device = assembly.on_device("cpu")
    values = evaluate_primitives(device, points)
    inside = evaluate_assembly(device, points) < 0.0
    image = np.zeros((len(points), 4), np.uint8)
    # A little darker than the outside, which catches light.
    image[:, :3] = 0.86 * blended_colors(assembly, values)
    image[:, 3] = np.where(inside, 255, 0)
    return _picture(image, axis, at, place)


def distance_bands(
    assembly: Assembly, axis: int, at: float, box: tuple[np.ndarray, np.ndarray]
) -> PlanePicture:
    """Signed distances on a plane: blue inside, orange outside, a line each twelfth of the plane's longer side."""
    points, place = _plane(axis, at, box)
    field = evaluate_assembly(assembly.on_device("cpu"), points).astype(np.float64)
    reach = float((np.asarray(box[1]) - box[0]).max())
    share = np.clip(np.abs(field) / (0.5 * reach), 0.0, 1.0)[:, None]
    color = np.where(field[:, None] < 0.0, INSIDE, OUTSIDE)
    shade = 1.0 + (0.35 + 0.65 * share**0.5) * (color - 1.0)
    phase = np.abs(field / (reach / BANDS) - np.round(field / (reach / BANDS))) * (reach / BANDS)
    pixel = reach / PIXELS
    line = np.clip(1.0 - phase / (0.6 * pixel), 0.0, 1.0)[:, None]
    surface = np.clip(1.5 - np.abs(field) / pixel, 0.0, 1.0)[:, None]
    shade = shade * (1.0 - 0.35 * line) * (1.0 - 0.85 * surface)
    image = np.concatenate([255.0 * shade, np.full((len(points), 1), 235.0)], axis=1).astype(np.uint8)
    return _picture(image, axis, at, place)


def _plane(
    axis: int, at: float, box: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray, int, int]]:
    """Points (n, 3) of the pixels, row by row; and the corners, rows and columns of the picture."""
    low, high = np.array(box[0], np.float64), np.array(box[1], np.float64)
    margin = 0.06 * float((high - low).max())
    low, high = low - margin, high + margin
    low[axis] = high[axis] = at
    u, v = (other for other in range(3) if other != axis)
    pixel = float((high - low).max()) / PIXELS
    columns = max(2, round((high[u] - low[u]) / pixel))
    rows = max(2, round((high[v] - low[v]) / pixel))
    points = np.full((rows, columns, 3), at, np.float32)
    points[:, :, u] = (low[u] + (np.arange(columns) + 0.5) * (high[u] - low[u]) / columns)[None, :]
    points[:, :, v] = (low[v] + (np.arange(rows) + 0.5) * (high[v] - low[v]) / rows)[:, None]
    return points.reshape(-1, 3), (low, high, rows, columns)


def _picture(
    image: np.ndarray, axis: int, at: float, place: tuple[np.ndarray, np.ndarray, int, int]
) -> PlanePicture:
    low, high, rows, columns = place
    u, v = (other for other in range(3) if other != axis)
    return PlanePicture(image.reshape(rows, columns, 4), (u, v), low, high)
