"""Pictures of assemblies and meshes without OpenGL: one camera and one studio for both, so that they compare.

Rays are cast for all pixels at once; what they hit is shaded with soft shadows and ambient occlusion, and a ground
below it catches the shadow. The assembly is traced as the field it is, not as a mesh of it.
"""

# No postponed annotations here: Warp reads the kernels' own.

import math
from typing import Protocol

import numpy as np
import warp as wp

from ..field.primitive_set import PrimitiveSet
from ..mesh.mesh_rows import is_crowded
from ..runtime.launch import PLAIN_OPTIONS, choose_device, launch
from .camera import Camera, Rays, camera_rays
from .mesh_scene import MeshScene
from .sdf_scene import SdfScene
from .shading import (
    GROUND_DARKNESS,
    KEY_SOFTNESS,
    Studio,
    background,
    develop,
    shade_ground_kernel,
    shade_surface_kernel,
)
from .sphere_trace import NO_HIT

wp.set_module_options(PLAIN_OPTIONS)

CLAY = (0.74, 0.74, 0.76)
"""Colour of a mesh that is given none, sRGB."""
PIXEL_SHARE = 0.05
"""Error of a hit in pixels."""
GROUND_REACH = 1.6
"""Radius of the ground that shows shadow, by the scene's size."""
LIFT = 1e-3
"""Shadow rays start this far above the surface, by the scene's size."""
MAX_PIXELS = 1 << 26


class Scene(Protocol):
    """Protocol of a scene to render; `sdf_scene` and `mesh_scene` say what the methods mean."""

    device: wp.Device
    lower: np.ndarray
    upper: np.ndarray
    size: float

    def hit(self, rays: Rays, tolerance: float) -> wp.array: ...
    def surface(self, rays: Rays, points: wp.array) -> tuple[wp.array, wp.array]: ...
    def openness(self, points: wp.array, normals: wp.array) -> wp.array: ...
    def light(self, rays: Rays, softness: float) -> wp.array: ...


@wp.kernel
def meet_ground_kernel(
    first: int,
    origin: wp.array[wp.vec3],
    direction: wp.array[wp.vec3],
    distance: wp.array[float],
    up: wp.vec3,
    middle: wp.vec3,
    radius: float,
    # outputs
    out_ground: wp.array[float],
):
    """Distance to the ground within `radius` of its middle, seen from above, where nothing stands before it."""
    r = first + wp.tid()
    out_ground[r] = NO_HIT
    steep = wp.dot(direction[r], up)
    if distance[r] >= NO_HIT and steep < -1.0e-6:
        t = wp.dot(middle - origin[r], up) / steep
        if t > 0.0 and wp.length(origin[r] + t * direction[r] - middle) < radius:
            out_ground[r] = t


@wp.kernel
def gather_hits_kernel(
    first: int,
    ids: wp.array[int],
    origin: wp.array[wp.vec3],
    direction: wp.array[wp.vec3],
    distance: wp.array[float],
    # outputs
    out_origin: wp.array[wp.vec3],
    out_direction: wp.array[wp.vec3],
    out_point: wp.array[wp.vec3],
):
    """The rays that hit, and where."""
    i = first + wp.tid()
    r = ids[i]
    out_origin[i] = origin[r]
    out_direction[i] = direction[r]
    out_point[i] = origin[r] + distance[r] * direction[r]


@wp.kernel
def lift_points_kernel(
    first: int,
    points: wp.array[wp.vec3],
    normals: wp.array[wp.vec3],
    height: float,
    out_points: wp.array[wp.vec3],
):
    """Points just above the surface."""
    i = first + wp.tid()
    out_points[i] = points[i] + height * normals[i]


def render_assembly(
    primitives: PrimitiveSet,
    colors: np.ndarray,
    camera: Camera,
    width: int = 640,
    height: int = 480,
    *,
    samples: int = 2,
    ground: bool = True,
) -> np.ndarray:
    """Picture of the smooth union, each part in its colour; colours run into each other at smooth joins.

    Args:
        primitives: the assembly, gates included.
        colors: (primitive_count, 3) sRGB in [0, 1].
        camera: in the normalised frame.
        width, height: of the picture, in pixels.
        samples: rays along each side of a pixel; 1 is fast and has steps along edges.
        ground: whether a shadow falls on a ground below the assembly.

    Returns:
        (height, width, 3) uint8, sRGB, row 0 on top. An empty assembly shows the background.

    Raises:
        ValueError: if colours do not match the primitives, or the size is not sensible.
    """
    colors = np.asarray(colors, np.float32).reshape(-1, 3)
    if len(colors) != len(primitives):
        raise ValueError(f"{len(primitives)} primitives but {len(colors)} colours")
    check_size(width, height, samples)
    return render(SdfScene(primitives, colors), camera, width, height, samples, ground)


def render_mesh(
    vertices: np.ndarray,
    faces: np.ndarray,
    camera: Camera,
    width: int = 640,
    height: int = 480,
    *,
    color: tuple[float, float, float] = CLAY,
    smooth: bool = True,
    samples: int = 2,
    ground: bool = True,
    device: wp.Device | None = None,
) -> np.ndarray:
    """Picture of a triangle mesh in one colour, from both sides, in the same studio as `render_assembly`.

    Args:
        vertices, faces: (v, 3) and (f, 3), in the camera's frame.
        camera, width, height, samples, ground: as for `render_assembly`.
        color: sRGB in [0, 1].
        smooth: whether normals are smoothed across edges that are no creases.
        device: where to render; the CPU unless given.

    Returns:
        (height, width, 3) uint8, sRGB, row 0 on top. A mesh without faces shows the background.
    """
    check_size(width, height, samples)
    device = device or choose_device("cpu")
    crowded = is_crowded(vertices, faces)
    # A ray through a crowd of faces costs ten times as much: there, one a pixel has to do, and none for what is around.
    samples, share = (1, CROWDED_SHARE) if crowded else (samples, samples * samples)
    scene = MeshScene(vertices, faces, color, device, smooth, share, occlusion=not crowded)
    return render(scene, camera, width, height, samples, ground)


CROWDED_SHARE = 12
"""Rays for soft light are divided by this in a crowd of faces: as few as there are."""


def check_size(width: int, height: int, samples: int) -> None:
    """Refuse pictures without pixels, or with more than fit into memory."""
    if width < 1 or height < 1 or not 1 <= samples <= 8 or width * height * samples**2 > MAX_PIXELS:
        raise ValueError(f"cannot render {width} x {height} pixels with {samples} x {samples} samples")


def render(scene: Scene, camera: Camera, width: int, height: int, samples: int, ground: bool) -> np.ndarray:
    """Picture (height, width, 3) uint8 of any scene."""
    rays = camera_rays(camera, width * samples, height * samples, scene.device)
    color = background(rays.count, width * samples, height * samples, scene.device)
    if scene.size > 0.0:
        pixel = 2.0 * math.tan(math.radians(0.5 * camera.field_of_view)) / (height * samples)
        distance = scene.hit(rays, PIXEL_SHARE * pixel)
        studio = Studio.around(camera)
        _shade_surface(scene, studio, rays, distance, color)
        if ground:
            _shade_ground(scene, studio, rays, distance, color)
    return develop(color, width, height, samples)


def _shade_surface(scene: Scene, studio: Studio, rays: Rays, distance: wp.array, color: wp.array) -> None:
    ids, seen, points = _hits(rays, distance)
    if not seen.count:
        return
    normals, albedo = scene.surface(seen, points)
    launch(
        shade_surface_kernel,
        seen.count,
        [
            ids,
            rays.direction,
            normals,
            albedo,
            _light(scene, studio, points, normals),
            scene.openness(points, normals),
            studio.key,
            studio.fill,
            studio.rim,
            studio.up,
        ],
        [color],
        scene.device,
        seconds_per_thread=8e-8,
    )


def _shade_ground(scene: Scene, studio: Studio, rays: Rays, distance: wp.array, color: wp.array) -> None:
    up = np.array(list(studio.up))
    middle = 0.5 * (scene.lower + scene.upper)
    # The lowest corner of the box along the up direction; a hair below, so that flat bottoms do not touch it.
    below = 0.5 * float(np.abs(up) @ (scene.upper - scene.lower)) + LIFT * scene.size
    centre = wp.vec3(*(middle - below * up).tolist())
    radius = GROUND_REACH * scene.size
    reached = wp.empty(rays.count, dtype=float, device=scene.device)
    launch(
        meet_ground_kernel,
        rays.count,
        [rays.origin, rays.direction, distance, studio.up, centre, radius],
        [reached],
        scene.device,
        seconds_per_thread=1e-8,
    )
    ids, seen, points = _hits(rays, reached)
    if not seen.count:
        return
    normals = wp.full(seen.count, studio.up, dtype=wp.vec3, device=scene.device)
    launch(
        shade_ground_kernel,
        seen.count,
        [
            ids,
            points,
            _light(scene, studio, points, normals),
            scene.openness(points, normals),
            centre,
            radius,
            GROUND_DARKNESS,
        ],
        [color],
        scene.device,
        seconds_per_thread=2e-8,
    )


def _hits(rays: Rays, distance: wp.array) -> tuple[wp.array, Rays, wp.array]:
    """Ids of the rays that hit something, these rays, and where they hit."""
    device = rays.device
    found = np.flatnonzero(distance.numpy() < float(NO_HIT)).astype(np.int32)
    count = len(found)
    ids = wp.array(found, dtype=int, device=device)
    origin, direction, points = (wp.empty(count, dtype=wp.vec3, device=device) for _ in range(3))
    launch(
        gather_hits_kernel,
        count,
        [ids, rays.origin, rays.direction, distance],
        [origin, direction, points],
        device,
        seconds_per_thread=1e-8,
    )
    return ids, Rays(origin, direction), points


def _light(scene: Scene, studio: Studio, points: wp.array, normals: wp.array) -> wp.array:
    """Share (n,) of the key light that reaches the points."""
    count = points.shape[0]
    origin = wp.empty(count, dtype=wp.vec3, device=scene.device)
    launch(
        lift_points_kernel,
        count,
        [points, normals, LIFT * scene.size],
        [origin],
        scene.device,
        seconds_per_thread=4e-9,
    )
    towards = wp.full(count, studio.key, dtype=wp.vec3, device=scene.device)
    return scene.light(Rays(origin, towards), KEY_SOFTNESS)
