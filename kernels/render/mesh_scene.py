"""A triangle mesh as something to take pictures of: the same questions as `sdf_scene`, answered by rays."""

# No postponed annotations here: Warp reads the kernels' own.

import math

import numpy as np
import warp as wp

from ..runtime.launch import PLAIN_OPTIONS, launch
from .camera import Rays
from .shading import to_linear
from .sphere_trace import NO_HIT

wp.set_module_options(PLAIN_OPTIONS)

RAY_SECONDS = 8e-7
CREASE = wp.constant(math.cos(math.radians(25.0)))
"""Normals are smoothed across edges that turn less than this."""
GOLDEN = wp.constant(2.399963)
"""The golden angle: directions that follow each other by it cover the circle evenly."""
OPEN_WITHIN = 0.3
"""Rays that test how open a place is reach this far, by the scene's size."""


@wp.kernel
def hit_mesh_kernel(
    first: int,
    mesh: wp.uint64,
    origin: wp.array[wp.vec3],
    direction: wp.array[wp.vec3],
    # outputs
    out_distance: wp.array[float],
):
    """Distance to the first face along a ray."""
    r = first + wp.tid()
    query = wp.mesh_query_ray(mesh, origin[r], direction[r], 1.0e6)
    out_distance[r] = wp.where(query.result, query.t, NO_HIT)


@wp.kernel
def mesh_normals_kernel(
    first: int,
    mesh: wp.uint64,
    faces: wp.array[int],
    vertex_normals: wp.array[wp.vec3],
    smooth: int,
    origin: wp.array[wp.vec3],
    direction: wp.array[wp.vec3],
    points: wp.array[wp.vec3],
    # outputs
    out_normal: wp.array[wp.vec3],
):
    """Normal at a ray's first hit, towards the eye; smoothed unless the face is at a crease."""
    r = first + wp.tid()
    n = -direction[r]
    # Where it hits is known: nothing beyond needs to be looked at.
    reach = 1.001 * wp.length(points[r] - origin[r])
    query = wp.mesh_query_ray(mesh, origin[r], direction[r], reach)
    if query.result:
        n = wp.mesh_eval_face_normal(mesh, query.face)
        if smooth == 1:
            a = vertex_normals[faces[3 * query.face]]
            b = vertex_normals[faces[3 * query.face + 1]]
            c = vertex_normals[faces[3 * query.face + 2]]
            if wp.dot(a, n) > CREASE and wp.dot(b, n) > CREASE and wp.dot(c, n) > CREASE:
                n = wp.normalize(query.u * a + query.v * b + (1.0 - query.u - query.v) * c)
        if wp.dot(n, direction[r]) > 0.0:
            n = -n
    out_normal[r] = n


@wp.func
def spread(i: int):
    """An angle and a number in [0, 1) that differ as evenly as can be between neighbours (Roberts' R2 sequence)."""
    turn = float(i % 65536) * 0.7548776662
    shift = float(i % 65536) * 0.5698402910
    return 6.2831853 * (turn - wp.floor(turn)), shift - wp.floor(shift)


@wp.func
def perpendicular(n: wp.vec3) -> wp.vec3:
    """A unit vector across another."""
    helper = wp.where(wp.abs(n[0]) < 0.6, wp.vec3(1.0, 0.0, 0.0), wp.vec3(0.0, 1.0, 0.0))
    return wp.normalize(wp.cross(n, helper))


@wp.kernel
def open_mesh_kernel(
    first: int,
    mesh: wp.uint64,
    points: wp.array[wp.vec3],
    normals: wp.array[wp.vec3],
    lower: wp.vec3,
    upper: wp.vec3,
    ray_count: int,
    lift: float,
    reach: float,
    # outputs
    out_openness: wp.array[float],
):
    """Share of cosine-distributed rays of length `reach` that meet nothing; nearer faces count more."""
    i = first + wp.tid()
    out_openness[i] = 1.0
    if wp.length(points[i] - wp.min(wp.max(points[i], lower), upper)) > 1.01 * reach:
        # Out of reach of the mesh's box, as most of the ground is.
        return
    n = normals[i]
    side = perpendicular(n)
    other = wp.cross(n, side)
    turn, shift = spread(i)
    closed = float(0.0)
    for k in range(ray_count):
        u = (float(k) + shift) / float(ray_count)
        radius = wp.sqrt(u)
        angle = turn + GOLDEN * float(k)
        d = radius * (wp.cos(angle) * side + wp.sin(angle) * other) + wp.sqrt(1.0 - u) * n
        query = wp.mesh_query_ray(mesh, points[i] + lift * n, d, reach)
        if query.result:
            closed += 1.0 - 0.6 * query.t / reach
    out_openness[i] = 1.0 - closed / float(ray_count)


@wp.kernel
def light_mesh_kernel(
    first: int,
    mesh: wp.uint64,
    origin: wp.array[wp.vec3],
    direction: wp.array[wp.vec3],
    middle: wp.vec3,
    radius: float,
    ray_count: int,
    softness: float,
    lift: float,
    # outputs
    out_light: wp.array[float],
):
    """Share of a light's disc that is seen, from rays spread over it; the mesh lies in a ball about its `middle`."""
    r = first + wp.tid()
    d = direction[r]
    out_light[r] = 1.0
    away = middle - origin[r]
    along = wp.dot(away, d)
    if wp.length(away - along * d) > 1.01 * (radius + softness * wp.max(along + radius, 0.0)):
        # The whole cone of rays passes it by.
        return
    side = perpendicular(d)
    other = wp.cross(d, side)
    turn, shift = spread(r)
    seen = float(0.0)
    for k in range(ray_count):
        aside = softness * wp.sqrt((float(k) + shift) / float(ray_count))
        angle = turn + GOLDEN * float(k)
        towards = wp.normalize(d + aside * (wp.cos(angle) * side + wp.sin(angle) * other))
        if not wp.mesh_query_ray_anyhit(mesh, origin[r] + lift * towards, towards, 1.0e6):
            seen += 1.0
    out_light[r] = seen / float(ray_count)


class MeshScene:
    """A triangle mesh of one colour.

    Attributes:
        lower, upper: corners (3,) of its box; both 0 if there is no face.
    """

    def __init__(
        self,
        vertices: np.ndarray,
        faces: np.ndarray,
        color: tuple[float, float, float],
        device: wp.Device,
        smooth: bool = True,
        rays_per_pixel: int = 1,
        occlusion: bool = True,
    ) -> None:
        """Take a mesh.

        Args:
            vertices: (v, 3).
            faces: (f, 3).
            color: sRGB in [0, 1].
            device: where to render.
            smooth: whether to smooth normals where there is no crease.
            rays_per_pixel: share the work for soft light.
            occlusion: whether places with little open around them are darker.
        """
        self.device = device
        vertices = np.ascontiguousarray(vertices, np.float32).reshape(-1, 3)
        faces = np.ascontiguousarray(faces, np.int32).reshape(-1, 3)
        self.lower, self.upper = np.zeros(3), np.zeros(3)
        self._mesh: wp.Mesh | None = None
        self._color = wp.vec3(*to_linear(np.array(color)).tolist())
        self._smooth = smooth
        self._open_rays = max(3, 12 // rays_per_pixel) if occlusion else 0
        self._light_rays = max(2, 8 // rays_per_pixel)
        if len(faces):
            used = vertices[faces.ravel()]
            self.lower, self.upper = used.min(axis=0).astype(float), used.max(axis=0).astype(float)
            self._faces = wp.array(faces.ravel(), dtype=int, device=device)
            self._mesh = wp.Mesh(wp.array(vertices, dtype=wp.vec3, device=device), self._faces)
            self._normals = wp.array(vertex_normals(vertices, faces), dtype=wp.vec3, device=device)
        self.size = float(np.linalg.norm(self.upper - self.lower))

    def hit(self, rays: Rays, tolerance: float) -> wp.array:
        """Distance (n,) to the surface along each ray."""
        distance = wp.full(rays.count, float(NO_HIT), dtype=float, device=self.device)
        if self._mesh is not None:
            launch(
                hit_mesh_kernel,
                rays.count,
                [self._mesh.id, rays.origin, rays.direction],
                [distance],
                self.device,
                seconds_per_thread=RAY_SECONDS,
            )
        return distance

    def surface(self, rays: Rays, points: wp.array) -> tuple[wp.array, wp.array]:
        """Unit normals and linear colours, both (n,) vec3, at hits `points` (n,) vec3 of the rays."""
        normals = wp.empty(rays.count, dtype=wp.vec3, device=self.device)
        launch(
            mesh_normals_kernel,
            rays.count,
            [
                self._mesh.id,
                self._faces,
                self._normals,
                int(self._smooth),
                rays.origin,
                rays.direction,
                points,
            ],
            [normals],
            self.device,
            seconds_per_thread=RAY_SECONDS,
        )
        return normals, wp.full(rays.count, self._color, dtype=wp.vec3, device=self.device)

    def openness(self, points: wp.array, normals: wp.array) -> wp.array:
        """Share (n,) of the surroundings that is open above points of a surface."""
        if not self._open_rays:
            return wp.ones(points.shape[0], dtype=float, device=self.device)
        result = wp.empty(points.shape[0], dtype=float, device=self.device)
        launch(
            open_mesh_kernel,
            points.shape[0],
            [
                self._mesh.id,
                points,
                normals,
                wp.vec3(*self.lower.tolist()),
                wp.vec3(*self.upper.tolist()),
                self._open_rays,
                2e-4 * self.size,
                OPEN_WITHIN * self.size,
            ],
            [result],
            self.device,
            seconds_per_thread=RAY_SECONDS * self._open_rays,
        )
        return result

    def light(self, rays: Rays, softness: float) -> wp.array:
        """Share (n,) of the light that reaches the origin of each ray towards it."""
        result = wp.empty(rays.count, dtype=float, device=self.device)
        launch(
            light_mesh_kernel,
            rays.count,
            [
                self._mesh.id,
                rays.origin,
                rays.direction,
                wp.vec3(*(0.5 * (self.lower + self.upper)).tolist()),
                0.5 * self.size,
                self._light_rays,
                softness,
                2e-4 * self.size,
            ],
            [result],
            self.device,
            seconds_per_thread=RAY_SECONDS * self._light_rays,
        )
        return result


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Unit normals (v, 3) float32, area-weighted over all faces at the same place, welded or not."""
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).astype(np.float64)
    _, place = np.unique(vertices, axis=0, return_inverse=True)
    place = place.ravel()
    total = np.zeros((place.max() + 1, 3))
    for corner in range(3):
        for axis in range(3):
            total[:, axis] += np.bincount(place[faces[:, corner]], across[:, axis], minlength=len(total))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return (total / np.maximum(length, 1e-30)).astype(np.float32)[place]
