"""Open patches of a mesh that bound a solid: by winding numbers beside them, else by flooding from outside.

Frame: normalised.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..kernels.mesh.inside_points import winding_numbers
from ..kernels.mesh.mesh_grid import unsigned_distance_grid
from ..kernels.mesh.mesh_query import MeshQuery
from .weld import face_areas

SHEET, BOUNDARY, INVERTED = 0, 1, 2
"""Verdicts: encloses nothing; bounds the solid; bounds it, but is inside out."""

MIN_PROBES, PROBES_PER_PATCH = 6, 48
MAX_PROBES = 3000
"""Points at which patches are judged: on each so many at least and at most, on all together about so many."""

STEPS = np.array([0.7548776662466927, 0.5698402909980532])
"""Steps that fill a square evenly (R2)."""

PROBE_OFFSET = 0.002
"""Distance of a probe from the surface: above rounding, below the thickness of what is worth fitting."""

CLEAR = 0.25
"""A winding number this near to a whole number is clear. Beside a sheet that encloses nothing it is off by 1/2."""

CLEAR_SHARE = 0.8
"""A patch bounds a solid if so many of its probes say so: beside a hole's rim none does."""

FLOOD_RESOLUTION = 96
WALL = 2.5 / FLOOD_RESOLUTION
"""Distance (1.25 cells) that the flood keeps from the surface: holes up to twice as wide are closed to it."""

MARCH = (1.2, 1.8, 2.6, 3.6)
"""Distances, in WALL, at which a probe looks for a cell that the surface does not touch."""


@dataclass(frozen=True)
class Probes:
    """Points on the patches, for verdicts."""

    points: np.ndarray
    """(n, 3) float64."""
    normals: np.ndarray
    """(n, 3) float64, unit."""
    patch: np.ndarray
    """(n,) int."""

    def share(self, yes: np.ndarray, patch_count: int) -> np.ndarray:
        """Share (patch_count,) of each patch's probes where `yes` (n,) holds; 0 for a patch without probes."""
        total = np.bincount(self.patch, minlength=patch_count)
        return np.bincount(self.patch, yes, patch_count) / np.maximum(total, 1)


def place_probes(vertices: np.ndarray, faces: np.ndarray, patch: np.ndarray) -> Probes:
    """Points on faces (m, 3), evenly spread over each of their patches (m,)."""
    area = face_areas(vertices, faces)
    order = np.argsort(patch, kind="stable")
    label, start, count = np.unique(patch[order], return_index=True, return_counts=True)
    each = max(MIN_PROBES, min(PROBES_PER_PATCH, MAX_PROBES // len(label)))
    running = np.concatenate([[0.0], np.cumsum(area[order])])
    low, high = running[start], running[start + count]
    share = (np.arange(each) + 0.5) / each
    place = low[:, None] + (high - low)[:, None] * share
    index = np.clip(
        np.searchsorted(running, place, side="right") - 1, start[:, None], (start + count - 1)[:, None]
    )
    chosen = order[index.ravel()]
    u, v = np.modf(np.arange(len(chosen))[:, None] * STEPS)[0].T
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u)[:, None], np.where(over, 1.0 - v, v)[:, None]
    a, b, c = (vertices[faces[chosen, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    length = np.linalg.norm(cross, axis=1)
    real = length > 0.0
    points = (a * (1.0 - u - v) + b * u + c * v)[real]
    return Probes(points, cross[real] / length[real][:, None], patch[chosen[real]])


def wind(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray, device: wp.Device) -> np.ndarray:
    """Winding numbers (n,) float32 of faces (m, 3) at points (n, 3)."""
    query = MeshQuery(vertices, faces, device)
    return winding_numbers(query, wp.array(points.astype(np.float32), dtype=wp.vec3, device=device)).numpy()


def judge_by_winding(
    vertices: np.ndarray, faces: np.ndarray, patch: np.ndarray, judged: np.ndarray, device: wp.Device
) -> np.ndarray:
    """Verdicts, BOUNDARY, INVERTED or SHEET (not clear), on the patches of some faces.

    Args:
        vertices: (n, 3). faces: (m, 3), all that wind. patch: (m,). judged: (m,) bool, faces of the patches to
            judge.
        device: where to compute.

    Returns:
        (patches,) int; BOUNDARY where nothing was judged.
    """
    count = int(patch.max()) + 1
    probes = place_probes(vertices, faces[judged], patch[judged])
    # Going inwards through the face adds one, so that the outer side tells both.
    winding = wind(vertices, faces, probes.points + PROBE_OFFSET * probes.normals, device)
    clear = np.abs(winding - np.round(winding)) < CLEAR
    verdict = np.full(count, BOUNDARY)
    verdict[np.unique(patch[judged])] = SHEET
    verdict[probes.share(clear & (winding > -0.5), count) >= CLEAR_SHARE] = BOUNDARY
    verdict[probes.share(clear & (winding < -0.5), count) >= CLEAR_SHARE] = INVERTED
    return verdict


def judge_by_flood(
    vertices: np.ndarray, faces: np.ndarray, patch: np.ndarray, judged: np.ndarray, device: wp.Device
) -> np.ndarray:
    """Verdicts on the patches of some faces, whichever way round these are; arguments as above.

    Space is flooded from outside, between all `faces`; what stays dry is inside.

    Returns:
        (patches,) int; BOUNDARY where nothing was judged.
    """
    # Few meshes come here, and all would wait for it.
    from scipy import ndimage

    count = int(patch.max()) + 1
    verdict = np.full(count, BOUNDARY)
    verdict[np.unique(patch[judged])] = SHEET
    distance = unsigned_distance_grid(MeshQuery(vertices, faces, device), FLOOD_RESOLUTION).numpy()
    label = np.zeros(distance.shape, np.int32)
    ndimage.label(distance > WALL, output=label)
    if label.max() < 2:
        return verdict
    probes = place_probes(vertices, faces[judged], patch[judged])
    front = _look(label, probes.points, probes.normals)
    back = _look(label, probes.points, -probes.normals)
    # The grid's corner is outside: the mesh ends at 0.9. A gap too narrow to look into counts as outside.
    dry_front, dry_back = front > 1, back > 1
    outwards = probes.share(dry_back & ~dry_front, count)
    inwards = probes.share(dry_front & ~dry_back, count)
    decided = np.maximum(outwards, inwards) >= 0.5
    verdict[decided & (outwards >= inwards) & (verdict == SHEET)] = BOUNDARY
    verdict[decided & (inwards > outwards)] = INVERTED
    return verdict


def _look(label: np.ndarray, points: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Label (n,) of the first cell along the way that is away from all surfaces; 0 if none is near."""
    found = np.zeros(len(points), label.dtype)
    resolution = len(label)
    for reach in MARCH:
        place = points + (reach * WALL) * directions
        cell = np.clip(((place + 1.0) * (0.5 * resolution)).astype(np.int64), 0, resolution - 1)
        here = label[cell[:, 0], cell[:, 1], cell[:, 2]]
        found = np.where(found == 0, here, found)
    return found
