"""Sphere tracing of a smooth union by wavefronts: all live rays take a step together, then finished ones drop out.

A step evaluates the union at one point of each live ray, in blocks of neighbouring rays, so that culling works as on
any other points. Fields that are steeper than a distance (superfrustum.md, "Lipschitz constant and reach") or only near
to one say which steps are safe; a ray that finds itself inside all the same goes back between its last two points.
"""

# No postponed annotations here: Warp reads the kernels' own.

from dataclasses import dataclass

import warp as wp

from ..field.bounds import safe_step
from ..field.evaluate import union_at
from ..field.points import padded_count
from ..field.primitive_set import PrimitiveSet
from ..runtime.launch import PLAIN_OPTIONS, launch
from .camera import Rays
from .ray_queue import RayQueue

wp.set_module_options(PLAIN_OPTIONS)

NO_HIT = wp.constant(1.0e30)
"""Distance along a ray that hits nothing."""
MAX_STEPS = 160
"""Steps of full length after which a ray that grazes a surface is given up."""
SHADOW_STEPS = 40
SHORTEST_FACTOR = 0.08
"""No field is taken to be worse than this, however flat the primitive."""


@dataclass(frozen=True)
class Box:
    """Bounding box of the surface; rays are followed only within."""

    lower: wp.vec3
    upper: wp.vec3


@wp.func
def box_span(lower: wp.vec3, upper: wp.vec3, origin: wp.vec3, direction: wp.vec3):
    """Ray-box intersection: where a ray enters and leaves; it misses where it leaves before it enters."""
    near = float(0.0)
    far = float(NO_HIT)
    for axis in range(3):
        slope = direction[axis]
        if wp.abs(slope) < 1.0e-12:
            if origin[axis] < lower[axis] or origin[axis] > upper[axis]:
                far = -1.0
        else:
            one = (lower[axis] - origin[axis]) / slope
            other = (upper[axis] - origin[axis]) / slope
            near = wp.max(near, wp.min(one, other))
            far = wp.min(far, wp.max(one, other))
    return near, far


@wp.kernel
def enter_box_kernel(
    first: int,
    origin: wp.array[wp.vec3],
    direction: wp.array[wp.vec3],
    lower: wp.vec3,
    upper: wp.vec3,
    start: float,
    # outputs
    out_distance: wp.array[float],
    out_end: wp.array[float],
    out_live: wp.array[int],
):
    """Span of a ray within the box, from `start` on."""
    r = first + wp.tid()
    near, far = box_span(lower, upper, origin[r], direction[r])
    near = wp.max(near, start)
    out_distance[r] = near
    out_end[r] = far
    out_live[r] = wp.where(far > near, 1, 0)


@wp.kernel
def advance_rays_kernel(
    first: int,
    ids: wp.array[int],
    field: wp.array[float],
    factor: float,
    tolerance: float,
    last: int,
    # outputs, read too
    out_distance: wp.array[float],
    out_before: wp.array[float],
    out_end: wp.array[float],
    out_hit: wp.array[int],
    out_live: wp.array[int],
):
    """One step of a live ray; `out_before` is the last distance outside, `out_end` the first known inside or beyond."""
    i = first + wp.tid()
    r = ids[i]
    f = field[i]
    t = out_distance[r]
    near = tolerance * (t + 1.0e-3)
    live = int(1)
    if f <= near:
        # Outside but close, or inside with no way back: either is the surface.
        if f >= -near or t - out_before[r] < near:
            out_hit[r] = 1
            live = 0
        else:
            out_end[r] = t
            out_distance[r] = 0.5 * (t + out_before[r])
    else:
        out_before[r] = t
        beyond = t + wp.max(factor * f, near)
        if beyond >= out_end[r]:
            # Towards a point known to be inside: half way. Towards the end of the box: done.
            if out_hit[r] < 0:
                beyond = 0.5 * (t + out_end[r])
            else:
                live = 0
        out_distance[r] = beyond
    if f < -near and live == 1:
        out_hit[r] = -1
    if last == 1 and live == 1:
        out_hit[r] = wp.where(f < 8.0 * near or out_hit[r] < 0, 1, 0)
    out_live[i] = live


@wp.kernel
def finish_rays_kernel(first: int, hit: wp.array[int], out_distance: wp.array[float]):
    """Distance to infinity where nothing was hit."""
    r = first + wp.tid()
    if hit[r] <= 0:
        out_distance[r] = NO_HIT


@wp.kernel
def darken_rays_kernel(
    first: int,
    ids: wp.array[int],
    field: wp.array[float],
    factor: float,
    softness: float,
    shortest: float,
    # outputs, read too
    out_distance: wp.array[float],
    out_end: wp.array[float],
    out_light: wp.array[float],
    out_live: wp.array[int],
):
    """One step towards the light: the share of it that passes is the narrowest clearance, relative to the distance."""
    i = first + wp.tid()
    r = ids[i]
    f = field[i]
    t = out_distance[r]
    light = wp.min(out_light[r], wp.clamp(0.5 + 0.5 * f / (softness * t), 0.0, 1.0))
    out_light[r] = light
    # Steps grow with the penumbra: what is thinner than it casts next to no shadow.
    t += wp.max(factor * f, shortest + 0.25 * softness * t)
    out_distance[r] = t
    out_live[i] = wp.where(light < 0.01 or t > out_end[r], 0, 1)


def _step_factor(primitives: PrimitiveSet) -> float:
    """Share of the field's value that is safe to step, but for places that backtracking takes care of."""
    return max(safe_step(primitives), SHORTEST_FACTOR)


def march_rays(primitives: PrimitiveSet, rays: Rays, box: Box, tolerance: float) -> wp.array:
    """Distance (n,) along each ray to the union's surface, NO_HIT where it meets none.

    Args:
        primitives: the assembly.
        rays: in blocks of neighbours.
        box: holds the surface.
        tolerance: largest error of the hit, per distance: a fraction of the angle that a pixel takes.
    """
    device = rays.device
    distance, end = (wp.empty(rays.count, dtype=float, device=device) for _ in range(2))
    hit = wp.zeros(rays.count, dtype=int, device=device)
    live = wp.empty(rays.count, dtype=int, device=device)
    _enter(rays, box, 0.0, distance, end, live)
    before = wp.clone(distance)
    front = RayQueue(rays, live)
    field = wp.empty(padded_count(rays.count), dtype=float, device=device)
    factor = _step_factor(primitives)
    step_count = round(MAX_STEPS / factor)
    for step in range(step_count):
        if not front.count:
            break
        union_at(primitives, front.points(distance), out_field=field)
        launch(
            advance_rays_kernel,
            front.count,
            [front.ids, field, factor, tolerance, int(step == step_count - 1)],
            [distance, before, end, hit, live],
            device,
            seconds_per_thread=6e-9,
        )
        front.drop_finished()
    launch(finish_rays_kernel, rays.count, [hit], [distance], device, seconds_per_thread=1e-9)
    return distance


def march_light(primitives: PrimitiveSet, rays: Rays, box: Box, softness: float, start: float) -> wp.array:
    """Share (n,) in [0, 1] of a light's disc of relative radius `softness` that is seen from each ray's origin."""
    device = rays.device
    distance, end = (wp.empty(rays.count, dtype=float, device=device) for _ in range(2))
    live = wp.empty(rays.count, dtype=int, device=device)
    light = wp.ones(rays.count, dtype=float, device=device)
    _enter(rays, box, start, distance, end, live)
    front = RayQueue(rays, live)
    field = wp.empty(padded_count(rays.count), dtype=float, device=device)
    factor = _step_factor(primitives)
    for _ in range(SHADOW_STEPS):
        if not front.count:
            break
        union_at(primitives, front.points(distance), out_field=field)
        launch(
            darken_rays_kernel,
            front.count,
            [front.ids, field, factor, softness, 0.25 * start],
            [distance, end, light, live],
            device,
            seconds_per_thread=6e-9,
        )
        front.drop_finished()
    return light


def _enter(rays: Rays, box: Box, start: float, distance: wp.array, end: wp.array, live: wp.array) -> None:
    launch(
        enter_box_kernel,
        rays.count,
        [rays.origin, rays.direction, box.lower, box.upper, start],
        [distance, end, live],
        rays.device,
        seconds_per_thread=1.5e-8,
    )
