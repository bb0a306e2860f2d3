"""A reconstruction made of meshes: each part is a primitive, and inside is where its own faces wind round.

Convex hulls, voxel boxes, the parts of a scene. Everything is in the target's normalised frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from ...kernels.mesh.inside_grid import classify_cells
from ...kernels.mesh.inside_points import winding_numbers
from ...kernels.mesh.mesh_query import MeshQuery
from ...kernels.runtime.launch import choose_device
from ...shape.topology import find_edges, is_balanced
from .assembly_metrics import RESOLUTION, Occupancy
from .prediction import mesh_distance
from .surface_metrics import draw_faces

OUTWARDS = 1e-3
"""Normalised units: a point of a part's surface is on that of the whole if this far outside is in no other part."""

INSIDE, CLEARLY_INSIDE = 0.5, 0.75
"""Winding numbers above which a point is inside a part; and so even if it lies at the face of an open one, where the
number is about 1/2."""

DRAWS = 8
"""Times that points are drawn until enough of them are on the outside."""


@dataclass(frozen=True)
class PartMesh:
    """One part's triangles."""

    vertices: np.ndarray
    """(n, 3) float64."""
    faces: np.ndarray
    """(m, 3) int, m > 0, counter-clockwise seen from outside."""


class PartsPrediction:
    """Meshes as a prediction: the union of their insides."""

    def __init__(self, parts: Sequence[PartMesh], floats: int, device: str = "auto") -> None:
        """Parts in the target's normalised frame; closed ones that are inside out are turned."""
        self.primitive_count, self.floats = len(parts), floats
        self.device = choose_device(device)
        self.parts = [turned_outwards(part) for part in parts]
        self._queries: list[MeshQuery | None] = [None] * len(parts)
        self.boxes = [(part.vertices.min(axis=0), part.vertices.max(axis=0)) for part in self.parts]
        self.lower, self.upper = np.zeros(3), np.zeros(3)
        if parts:
            self.lower = np.min([low for low, _ in self.boxes], axis=0)
            self.upper = np.max([high for _, high in self.boxes], axis=0)

    def query(self, index: int) -> MeshQuery:
        """Queries of one part; made when first asked for."""
        query = self._queries[index]
        if query is None:
            part = self.parts[index]
            query = self._queries[index] = MeshQuery(part.vertices, part.faces, self.device)
        return query

    def occupancy(self) -> Occupancy:
        """See `Prediction`."""
        count = np.zeros((RESOLUTION,) * 3, np.uint16)
        for part, (lower, upper) in zip(self.parts, self.boxes, strict=True):
            found = _cells_of_part(part, lower, upper, self.device)
            if found is not None:
                count[found[0]] += found[1]
        return Occupancy(count > 0, count)

    def inside(self, points: np.ndarray) -> np.ndarray:
        """See `Prediction`."""
        return self._wound(points, lambda index, asked: np.full(len(asked), INSIDE))

    def _wound(self, points: np.ndarray, limits: Callable[[int, np.ndarray], np.ndarray]) -> np.ndarray:
        """Winding test: True if some part winds round points (n, 3) more often than it must, (n,) bool.

        `limits(part, asked)` gives how often, (k,), for some of the points (k,) int.
        """
        result = np.zeros(len(points), bool)
        for index, near in self._near(points):
            asked = near[~result[near]]
            if len(asked):
                queried = wp.array(
                    np.ascontiguousarray(points[asked], np.float32), dtype=wp.vec3, device=self.device
                )
                winding = winding_numbers(self.query(index), queried).numpy()
                result[asked] = winding > limits(index, asked)
        return result

    def _near(self, points: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
        """Each part with the points (k,) that lie in its box."""
        for index, (lower, upper) in enumerate(self.boxes):
            yield index, np.flatnonzero(((points >= lower) & (points <= upper)).all(axis=1))

    def owners(self, points: np.ndarray) -> np.ndarray:
        """See `Prediction`."""
        return self._nearest(points)[1]

    def distance(self, points: np.ndarray) -> np.ndarray:
        """See `Prediction`. Faces inside other parts count as well: they are rarely the nearest."""
        return self._nearest(points)[0]

    def _nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (n,) to the nearest part's faces, and which part that is, (n,) int."""
        best = np.full(len(points), np.inf, np.float32)
        owner = np.zeros(len(points), np.int64)
        for index, (lower, upper) in enumerate(self.boxes):
            outside = np.linalg.norm(np.maximum(np.maximum(lower - points, points - upper), 0.0), axis=1)
            asked = np.flatnonzero(outside < best)
            if not len(asked):
                continue
            found = mesh_distance(self.query(index), points[asked])
            nearer = found < best[asked]
            best[asked[nearer]] = found[nearer]
            owner[asked[nearer]] = index
        return best, owner

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """See `Prediction`. Points of a part's surface that lie in another part, or against it, are left out.

        Where the surfaces of two parts coincide, the points of the first one are taken.
        """
        if not self.parts:
            return np.zeros((0, 3), np.float32)
        vertices, faces = joined(self.parts)
        part_of_face = np.repeat(np.arange(len(self.parts)), [len(part.faces) for part in self.parts])
        corners = vertices[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        if not length.max() > 0.0:
            return np.zeros((0, 3), np.float32)
        normals /= np.where(length > 0.0, length, 1.0)
        drawn, total = [], 0
        for _ in range(DRAWS):
            points, face = draw_faces(vertices, faces, 2 * count, rng)
            drawn.append(points[self._on_outside(points, normals[face], part_of_face[face])])
            total += len(drawn[-1])
            if total >= count:
                break
        kept = np.concatenate(drawn)
        # Hardly anything is on the outside: the same few points have to do.
        return kept[np.arange(count) % len(kept)] if len(kept) else kept

    def _on_outside(self, points: np.ndarray, normals: np.ndarray, own: np.ndarray) -> np.ndarray:
        """Mask of points (n, 3) of surfaces of parts `own` (n,) that are on that of the union, (n,) bool."""
        step = OUTWARDS * normals

        def covering(index: int, asked: np.ndarray) -> np.ndarray:
            return np.where(own[asked] == index, CLEARLY_INSIDE, INSIDE)

        def earlier(index: int, asked: np.ndarray) -> np.ndarray:
            return np.where(own[asked] > index, INSIDE, np.inf)

        covered = self._wound((points + step).astype(np.float32), covering)
        return ~(covered | self._wound((points - step).astype(np.float32), earlier))


def joined(parts: Sequence[PartMesh]) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (v, 3) and faces (f, 3) of all parts together."""
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    return np.concatenate([part.vertices for part in parts]), np.concatenate(faces)


def turned_outwards(part: PartMesh) -> PartMesh:
    """A closed part with its faces counter-clockwise seen from outside; an open one as it is."""
    a, b, c = (part.vertices[part.faces[:, corner]] for corner in range(3))
    volume = float(np.einsum("ij,ij->", a, np.cross(b, c)))
    if volume < 0.0 and is_balanced(find_edges(part.faces)):
        return PartMesh(part.vertices, part.faces[:, ::-1])
    return part


def _cells_of_part(
    part: PartMesh, lower: np.ndarray, upper: np.ndarray, device: wp.Device
) -> tuple[tuple[slice, slice, slice], np.ndarray] | None:
    """Occupancy of a part: its place in the 128^3 cells of [-1, 1]^3, and its cells inside; None if nowhere.

    Only a cube of cells around the part is looked at: as a grid of its own, in which it fills [-1, 1]^3.
    """
    spacing = 2.0 / RESOLUTION
    first = np.clip(np.floor((lower + 1.0) / spacing).astype(int), 0, RESOLUTION)
    last = np.clip(np.ceil((upper + 1.0) / spacing).astype(int), 0, RESOLUTION)
    extent = last - first
    if (extent < 1).any():
        return None
    side = int(extent.max())
    half = 0.5 * side * spacing
    middle = first * spacing - 1.0 + half
    query = MeshQuery((part.vertices - middle) / half, part.faces, device)
    inside = np.asarray(classify_cells(query, side)[0].numpy(), bool)
    x, y, z = (slice(int(a), int(b)) for a, b in zip(first, last, strict=True))
    return (x, y, z), inside[: extent[0], : extent[1], : extent[2]]
