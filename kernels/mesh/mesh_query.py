"""Queries of a triangle mesh: closest points, signed distances, rays.

Everything is in one frame, usually the normalised one (bounding box centred, longest side 1.8). Faces are
ordered counter-clockwise seen from outside. The sign of a distance is the winding number's: a point is
inside where the mesh winds round it more than half a time, which is exact for closed meshes, their overlaps
and cavities, and a sensible guess for open ones. An inverted mesh has nothing inside: its caller flips it.
Not differentiable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..runtime.launch import PLAIN_OPTIONS, launch
from .slivers import widen_slivers

wp.set_module_options(PLAIN_OPTIONS)

UNBOUNDED = 1.0e6
"""Search distance that stands for none: its square is still finite in float32."""

WINDING_ACCURACY = 1.5
"""Parts of the mesh further off than this many of their own radii count as one dipole. The winding number is then
right to 0.015; 2 takes nearly twice as long and decides one point in a thousand near messy surfaces otherwise."""


@dataclass(frozen=True)
class ClosestPoints:
    """Closest points of the mesh to n points; a point with nothing within the search distance has face -1."""

    distance: wp.array
    """(n,) float32, unsigned; infinity where nothing was found."""
    point: wp.array
    """(n,) vec3, the nearest point on the surface; the query point itself where nothing was found."""
    face: wp.array
    """(n,) int32."""


@dataclass(frozen=True)
class RayHits:
    """First hits of n rays; a ray that hits nothing has face -1, distance infinity and normal 0."""

    distance: wp.array
    """(n,) float32 along the ray, in lengths of its direction."""
    face: wp.array
    """(n,) int32."""
    normal: wp.array
    """(n,) vec3, unit normal of the face, on its outer side whichever side was hit."""


class MeshQuery:
    """A triangle mesh on a device, ready for queries.

    Attributes:
        device: where it lies.
        vertices: (n,) vec3; more than were given if slivers had to be widened to be seen.
        faces: (3 m,) int32, three vertices a face.
        face_count: m.
        mesh: the Warp mesh; kernels take `mesh.id`.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, device: wp.Device) -> None:
        """Copy the mesh to `device` and build its bounding volume hierarchy.

        That takes 20 ms for 40 000 faces on one core.

        Args:
            vertices: (n, 3) float, finite.
            faces: (m, 3) int, m > 0. Degenerate and duplicate faces are allowed.
            device: where queries will run.

        Raises:
            ValueError: if a shape is wrong, there is no face, an index is out of range, or a vertex not finite.
        """
        vertices, faces = np.asarray(vertices), np.asarray(faces)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
            raise ValueError(
                f"expected vertices (n, 3) and faces (m, 3), got {vertices.shape}, {faces.shape}"
            )
        if len(faces) == 0:
            raise ValueError("the mesh has no faces")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise ValueError(f"a face names a vertex outside 0 to {len(vertices) - 1}")
        if not np.isfinite(vertices).all():
            raise ValueError("a vertex is not finite")
        self.device = device
        self.face_count = len(faces)
        vertices, faces = widen_slivers(np.asarray(vertices, np.float32), np.asarray(faces, np.int32))
        self.vertices = wp.array(np.ascontiguousarray(vertices), dtype=wp.vec3, device=device)
        self.faces = wp.array(np.ascontiguousarray(faces).ravel(), dtype=int, device=device)
        self.mesh = wp.Mesh(self.vertices, self.faces, support_winding_number=True)

    def closest_points(self, points: wp.array, max_distance: float = UNBOUNDED) -> ClosestPoints:
        """The nearest surface point of each of points (n,) vec3; the smaller `max_distance`, the faster."""
        count = len(points)
        distance = wp.empty(count, dtype=float, device=self.device)
        nearest = wp.empty(count, dtype=wp.vec3, device=self.device)
        face = wp.empty(count, dtype=int, device=self.device)
        launch(
            find_closest_kernel,
            count,
            [self.mesh.id, points, max_distance],
            [distance, nearest, face],
            self.device,
            seconds_per_thread=1e-6,
        )
        return ClosestPoints(distance, nearest, face)

    def signed_distance(self, points: wp.array) -> wp.array:
        """Distance (n,) at points (n,) vec3, negative where the winding number exceeds 1/2."""
        distance = wp.empty(len(points), dtype=float, device=self.device)
        launch(
            measure_signed_kernel,
            len(points),
            [self.mesh.id, points, UNBOUNDED, WINDING_ACCURACY],
            [distance],
            self.device,
            seconds_per_thread=6e-6,
        )
        return distance

    def cast_rays(self, origins: wp.array, directions: wp.array, max_distance: float = UNBOUNDED) -> RayHits:
        """First hits of the rays origins + t directions, 0 <= t < max_distance; both (n,) vec3."""
        count = len(origins)
        distance = wp.empty(count, dtype=float, device=self.device)
        face = wp.empty(count, dtype=int, device=self.device)
        normal = wp.empty(count, dtype=wp.vec3, device=self.device)
        launch(
            cast_rays_kernel,
            count,
            [self.mesh.id, origins, directions, max_distance],
            [distance, face, normal],
            self.device,
            seconds_per_thread=5e-7,
        )
        return RayHits(distance, face, normal)


@wp.func_native("return wp::mesh_query_winding_number(mesh, point, accuracy);")
def winding_number(mesh: wp.uint64, point: wp.vec3, accuracy: float) -> float:
    """Winding number about `point`. Warp's Python functions tell only its sign against a threshold."""


@wp.kernel
def find_closest_kernel(
    first: int,
    mesh: wp.uint64,
    points: wp.array[wp.vec3],
    max_distance: float,
    # outputs
    out_distance: wp.array[float],
    out_point: wp.array[wp.vec3],
    out_face: wp.array[int],
):
    i = first + wp.tid()
    point = points[i]
    query = wp.mesh_query_point_no_sign(mesh, point, max_distance)
    if query.result:
        nearest = wp.mesh_eval_position(mesh, query.face, query.u, query.v)
        out_distance[i] = wp.length(nearest - point)
        out_point[i] = nearest
        out_face[i] = query.face
    else:
        out_distance[i] = wp.inf
        out_point[i] = point
        out_face[i] = -1


@wp.kernel
def measure_signed_kernel(
    first: int,
    mesh: wp.uint64,
    points: wp.array[wp.vec3],
    max_distance: float,
    accuracy: float,
    # outputs
    out_distance: wp.array[float],
):
    i = first + wp.tid()
    point = points[i]
    out_distance[i] = wp.inf
    query = wp.mesh_query_point_sign_winding_number(mesh, point, max_distance, accuracy, 0.5)
    if query.result:
        nearest = wp.mesh_eval_position(mesh, query.face, query.u, query.v)
        out_distance[i] = query.sign * wp.length(nearest - point)


@wp.kernel
def cast_rays_kernel(
    first: int,
    mesh: wp.uint64,
    origins: wp.array[wp.vec3],
    directions: wp.array[wp.vec3],
    max_distance: float,
    # outputs
    out_distance: wp.array[float],
    out_face: wp.array[int],
    out_normal: wp.array[wp.vec3],
):
    i = first + wp.tid()
    query = wp.mesh_query_ray(mesh, origins[i], directions[i], max_distance)
    if query.result:
        out_distance[i] = query.t
        out_face[i] = query.face
        out_normal[i] = wp.normalize(wp.mesh_eval_face_normal(mesh, query.face))
    else:
        out_distance[i] = wp.inf
        out_face[i] = -1
        out_normal[i] = wp.vec3(0.0, 0.0, 0.0)
