"""Specks: small components so far from the bulk of a mesh that they would make it tiny in its bounding box."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .weld import WELD_STEPS, face_areas

SHARE = 0.01
"""Specks have less than this share of the surface, and of the enclosed volume."""

SHRINKING = 4.0
"""Without specks the longest side is less than 1 / SHRINKING: the shape would be fitted in a corner of the grid."""

SAMPLE = 4_000
"""About so many faces tell whether all must be looked at."""

BINS = 64
"""Of each histogram along an axis; the bulk is looked for again within the bins that hold it."""


def find_specks(
    vertices: npt.NDArray[np.float64], faces: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.bool_], str]:
    """Faces of specks, and a sentence that names them.

    Args:
        vertices: (n, 3), mesh units, not welded; those used by faces finite.
        faces: (m, 3), m > 0.

    Returns:
        (m,) bool, all False where there are none, and the sentence, empty then.
    """
    none = np.zeros(len(faces), bool)
    lower, upper = (
        np.array([bound(vertices[faces[:, k]], axis=0) for k in range(3)]) for bound in (np.min, np.max)
    )
    lower, upper = lower.min(axis=0), upper.max(axis=0)
    # Halves first: the difference of two large numbers may overflow.
    side = float((upper / 2 - lower / 2).max()) * 2.0
    if not 0.0 < side < np.inf:
        return none, ""
    few = faces[:: max(1, len(faces) // SAMPLE)]
    if len(few) < len(faces) and not _has_far_faces((vertices[few] - lower) / side):
        return none, ""
    # Relative to the size, so that areas neither overflow nor vanish.
    corners = (vertices[faces] - lower) / side
    if not _has_far_faces(corners):
        return none, ""
    areas = _areas(corners)
    low, high = _bulk(corners, areas)
    reach = float((high - low).max())
    label, count = _components(corners, reach)
    least, most = _boxes(corners, label, count)
    far = np.any((most < low - reach) | (least > high + reach), axis=1)
    specks = far[label]
    # Where it is made of tiny pieces all about, all of it is far, or what is left is as large as before.
    if not specks.any() or specks.all() or np.ptp(corners[~specks], axis=(0, 1)).max() * SHRINKING >= 1.0:
        return none, ""
    volumes = _volumes(corners, label, count)
    share = areas[specks].sum() / areas.sum()
    if max(share, volumes[far].sum() / max(volumes.sum(), np.finfo(float).tiny)) >= SHARE:
        return none, ""
    distance = side * np.linalg.norm(np.maximum(np.maximum(low - most, least - high), 0.0)[far], axis=1).min()
    return specks, _sentence(int(specks.sum()), int(far.sum()), share, distance)


def _has_far_faces(corners: np.ndarray) -> bool:
    """True if the bulk of faces (m, 3, 3), in a frame where all are of size 1, is small enough for specks."""
    areas = _areas(corners)
    if not areas.sum() > 0.0:
        return False
    low, high = _bulk(corners, areas)
    return (high - low).max() * SHRINKING < 1.0


def _areas(corners: np.ndarray) -> np.ndarray:
    return face_areas(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def _sentence(faces: int, components: int, share: float, distance: float) -> str:
    what = f"{faces} face{'' if faces == 1 else 's'}"
    if components > 1:
        what += f" in {components} pieces"
    verb = "was" if faces == 1 else "were"
    percent = f"{100.0 * share:.2g} %" if share >= 1e-5 else "less than 0.001 %"
    return f"{what}, {distance:.3g} or more away from the rest and {percent} of the surface, {verb} left out."


def _bulk(corners: np.ndarray, areas: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The bounding box (3,), (3,) of faces (m, 3, 3) that have at least 1 - 3 SHARE of the area.

    Quantiles along each axis choose them, by histograms that are refined as long as the box shrinks by half.
    """
    middles, inside = corners.mean(axis=1), np.ones(len(corners), bool)
    low, high = np.zeros(3), np.ones(3)
    while True:
        step = np.maximum((high - low) / BINS, np.finfo(float).tiny)
        bins = np.clip((middles - low) / step, 0, BINS - 1).astype(np.int64)
        for axis in range(3):
            sums = np.cumsum(np.bincount(bins[:, axis], areas, minlength=BINS))
            first = np.searchsorted(sums, SHARE / 2 * sums[-1], side="right")
            last = np.searchsorted(sums, (1.0 - SHARE / 2) * sums[-1])
            inside &= (bins[:, axis] >= first) & (bins[:, axis] <= last)
        if not inside.any():
            return low, high
        inner_low, inner_high = corners[inside].min(axis=(0, 1)), corners[inside].max(axis=(0, 1))
        if (inner_high - inner_low).max() > 0.5 * (high - low).max():
            return low, high
        low, high = inner_low, inner_high


def _components(corners: np.ndarray, reach: float) -> tuple[np.ndarray, int]:
    """Labels (m,) of the connected components of faces (m, 3, 3), and their count; equal but for rounding is equal."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    cells = np.round(corners.reshape(-1, 3) * (WELD_STEPS / max(reach, 1e-9))).astype(np.int64)
    _, vertex = np.unique(cells, axis=0, return_inverse=True)
    vertex = vertex.reshape(-1, 3)
    count = int(vertex.max()) + 1
    ends = np.concatenate([vertex[:, :2], vertex[:, 1:]])
    graph = coo_array((np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    kinds, label = np.unique(label[vertex[:, 0]], return_inverse=True)
    return label, len(kinds)


def _boxes(corners: np.ndarray, label: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corners (count, 3) of the components' bounding boxes."""
    least, most = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(least, label, corners.min(axis=1))
    np.maximum.at(most, label, corners.max(axis=1))
    return least, most


def _volumes(corners: np.ndarray, label: np.ndarray, count: int) -> np.ndarray:
    """Volumes (count,) that components enclose, seen from their own first corner: 0 of flat ones."""
    start = np.zeros((count, 3))
    start[label[::-1]] = corners[::-1, 0]
    away = corners - start[label][:, None]
    signed = np.einsum("mc,mc->m", away[:, 0], np.cross(away[:, 1], away[:, 2])) / 6.0
    return np.abs(np.bincount(label, signed, minlength=count))
