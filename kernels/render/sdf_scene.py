"""An assembly as something to take pictures of: hits, normals, colours, openness and light from its field."""

# No postponed annotations here: Warp reads the kernels' own.

import numpy as np
import warp as wp

from ..contour.isosurface import tight_bounds
from ..field.combine import FAR, gated, quarter_inverse, smooth_minimum, smooth_minimum_share
from ..field.evaluate import primitives_at, union_at
from ..field.gradient import union_gradient_at
from ..field.points import BLOCK, PointBlocks, padded_count
from ..field.primitive_set import PrimitiveSet
from ..rows import BLEND_C, GATE_C, ROW_C
from ..runtime.launch import PLAIN_OPTIONS, launch
from .camera import Rays
from .shading import to_linear
from .sphere_trace import Box, march_light, march_rays

wp.set_module_options(PLAIN_OPTIONS)

COLOR_CHUNK = 1024 * BLOCK
"""Points coloured at once: every primitive is evaluated at each."""
PROBES = (0.012, 0.035, 0.075, 0.13, 0.2)
"""Distances along the normal, by the scene's size, at which openness is probed."""
MARGIN = 0.01
LIGHT_MARGIN = 0.12
"""Room around the surface, by the scene's size, within which rays are followed; half shadows need more."""


@wp.kernel
def place_probes_kernel(
    first: int,
    count: int,
    origin: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    height: float,
    # outputs
    out_x: wp.array[float],
    out_y: wp.array[float],
    out_z: wp.array[float],
):
    """A point above the surface; the last one again in the padding."""
    i = first + wp.tid()
    j = wp.min(i, count - 1)
    p = origin[j] + height * normal[j]
    out_x[i] = p[0]
    out_y[i] = p[1]
    out_z[i] = p[2]


@wp.kernel
def add_probe_kernel(
    first: int,
    field: wp.array[float],
    height: float,
    weight: float,
    # outputs, read too
    out_openness: wp.array[float],
):
    """Take away the share of the height by which the surface is nearer than over a plane."""
    i = first + wp.tid()
    out_openness[i] -= weight * wp.clamp(1.0 - field[i] / height, 0.0, 1.0)


@wp.kernel
def unite_normals_kernel(
    first: int,
    x: wp.array[float],
    y: wp.array[float],
    z: wp.array[float],
    direction: wp.array[wp.vec3],
    # outputs
    out_normal: wp.array[wp.vec3],
):
    """Unit normal from the field's gradient, towards the eye where there is none."""
    i = first + wp.tid()
    n = wp.vec3(x[i], y[i], z[i])
    size = wp.length(n)
    out_normal[i] = wp.where(size > 1.0e-6, n / wp.max(size, 1.0e-6), -direction[i])


@wp.kernel
def blend_colors_kernel(
    first: int,
    values: wp.array[float],
    stride: int,
    rows: wp.array[float],
    primitive_count: int,
    colors: wp.array[wp.vec3],
    begin: int,
    # outputs
    out_albedo: wp.array[wp.vec3],
):
    """Fold the parts' colours as the union folds their distances: they run into each other where joins are smooth."""
    i = first + wp.tid()
    field = float(FAR)
    color = wp.vec3()
    for k in range(primitive_count):
        value = gated(values[k * stride + i], rows[k * ROW_C + GATE_C])
        blend = rows[k * ROW_C + BLEND_C]
        quarter = quarter_inverse(blend)
        keep = smooth_minimum_share(field, value, quarter)
        color = keep * color + (1.0 - keep) * colors[k]
        field = smooth_minimum(field, value, blend, quarter)
    out_albedo[begin + i] = color


class SdfScene:
    """A smooth union with a colour per primitive.

    Attributes:
        lower, upper: corners (3,) of a box around the surface; both 0 if there is none.
    """

    def __init__(self, primitives: PrimitiveSet, colors: np.ndarray) -> None:
        """Colours are (primitive_count, 3), sRGB in [0, 1]."""
        self.primitives = primitives
        self.device = primitives.device
        self.colors = wp.array(to_linear(colors), dtype=wp.vec3, device=self.device)
        self.lower, self.upper = tight_bounds(primitives)
        self.size = float(np.linalg.norm(self.upper - self.lower))

    def hit(self, rays: Rays, tolerance: float) -> wp.array:
        """Distance (n,) to the surface along each ray."""
        return march_rays(self.primitives, rays, self._box(MARGIN), tolerance)

    def surface(self, rays: Rays, points: wp.array) -> tuple[wp.array, wp.array]:
        """Unit normals and linear colours, both (n,) vec3, at hits `points` (n,) vec3 of the rays."""
        blocks = self._blocks(points, points, 0.0)
        _, x, y, z = union_gradient_at(self.primitives, blocks)
        normals, albedo = (wp.empty(rays.count, dtype=wp.vec3, device=self.device) for _ in range(2))
        launch(
            unite_normals_kernel,
            rays.count,
            [x, y, z, rays.direction],
            [normals],
            self.device,
            seconds_per_thread=8e-9,
        )
        for begin in range(0, rays.count, COLOR_CHUNK):
            chunk = slice(begin, min(begin + COLOR_CHUNK, blocks.x.shape[0]))
            part = PointBlocks(blocks.x[chunk], blocks.y[chunk], blocks.z[chunk], chunk.stop - begin)
            values = primitives_at(self.primitives, part)
            launch(
                blend_colors_kernel,
                min(part.count, rays.count - begin),
                [values, part.count, self.primitives.rows, len(self.primitives), self.colors, begin],
                [albedo],
                self.device,
                seconds_per_thread=6e-9 * len(self.primitives),
            )
        return normals, albedo

    def openness(self, points: wp.array, normals: wp.array) -> wp.array:
        """Share (n,) of the surroundings that is open above points of a surface, from the field above them."""
        result = wp.ones(points.shape[0], dtype=float, device=self.device)
        weight = 0.31
        for share in PROBES:
            height = share * self.size
            field = union_at(self.primitives, self._blocks(points, normals, height))
            launch(
                add_probe_kernel,
                points.shape[0],
                [field, height, weight],
                [result],
                self.device,
                seconds_per_thread=2e-9,
            )
            weight *= 0.62
        return result

    def light(self, rays: Rays, softness: float) -> wp.array:
        """Share (n,) of the light that reaches the origin of each ray towards it."""
        return march_light(self.primitives, rays, self._box(LIGHT_MARGIN), softness, 0.004 * self.size)

    def _box(self, margin: float) -> Box:
        low, high = self.lower - margin * self.size, self.upper + margin * self.size
        return Box(wp.vec3(*low.tolist()), wp.vec3(*high.tolist()))

    def _blocks(self, points: wp.array, normals: wp.array, height: float) -> PointBlocks:
        count = points.shape[0]
        x, y, z = (wp.empty(padded_count(count), dtype=float, device=self.device) for _ in range(3))
        launch(
            place_probes_kernel,
            padded_count(count),
            [count, points, normals, float(height)],
            [x, y, z],
            self.device,
            seconds_per_thread=5e-9,
        )
        return PointBlocks(x, y, z, count)
