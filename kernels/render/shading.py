"""A studio for previews: light background, soft key light from the upper left, fill from the right, a shadow below.

Colours are linear light until `develop` turns them into the picture's bytes.
"""

# No postponed annotations here: Warp reads the kernels' own.

from dataclasses import dataclass

import numpy as np
import warp as wp

from .. import srgb
from ..runtime.launch import PLAIN_OPTIONS, launch
from .camera import TILE_C, Camera, pixel_of_ray

wp.set_module_options(PLAIN_OPTIONS)

BACKGROUND_TOP = (0.975, 0.98, 0.985)
BACKGROUND_BOTTOM = (0.86, 0.875, 0.895)
"""The background's colours, as shown (sRGB)."""
KEY_SOFTNESS = 0.14
"""Radius of the key light relative to its distance: how soft shadows are."""
GROUND_DARKNESS = 0.62
"""How much of the background's light the deepest shadow on the ground takes away."""


@dataclass(frozen=True)
class Studio:
    """Directions of the lights for a camera, each a unit vector towards the light."""

    key: wp.vec3
    fill: wp.vec3
    rim: wp.vec3
    up: wp.vec3

    @staticmethod
    def around(camera: Camera) -> "Studio":
        """Lights that stay where they are relative to the viewer, but upright."""
        right, _, forward = camera.axes
        up = np.asarray(camera.up, np.float64) / np.linalg.norm(camera.up)
        level = forward - up * (forward @ up)
        level = level / max(float(np.linalg.norm(level)), 1e-9)

        def towards(sideways: float, upwards: float, backwards: float) -> wp.vec3:
            direction = sideways * right + upwards * up - backwards * level
            return wp.vec3(*(float(value) for value in direction / np.linalg.norm(direction)))

        return Studio(
            towards(-0.55, 0.95, 0.6),
            towards(0.9, 0.25, 0.5),
            towards(0.3, 0.5, -1.0),
            towards(0.0, 1.0, 0.0),
        )


def to_linear(colors: np.ndarray) -> np.ndarray:
    """Linear light from sRGB values, both in [0, 1], any shape, float32."""
    colors = np.clip(np.asarray(colors, np.float32), 0.0, 1.0)
    return srgb.to_linear(colors)


@wp.func
def displayed(x: float) -> float:
    """sRGB value of linear light; highlights roll off instead of clipping."""
    shown = wp.where(x > 0.7, 0.7 + 0.3 * (1.0 - wp.exp(-(x - 0.7) / 0.3)), wp.max(x, 0.0))
    return wp.where(shown <= 0.0031308, shown * 12.92, 1.055 * wp.pow(shown, 1.0 / 2.4) - 0.055)


@wp.func
def lit(
    albedo: wp.vec3,
    normal: wp.vec3,
    view: wp.vec3,
    key: wp.vec3,
    fill: wp.vec3,
    rim: wp.vec3,
    up: wp.vec3,
    light: float,
    openness: float,
) -> wp.vec3:
    """Colour of a surface point; `view` points to the eye, `light` is the visible share of the key light."""
    sky = 0.5 + 0.5 * wp.dot(normal, up)
    ambient = (0.13 + 0.33 * sky) * openness
    direct = 0.98 * light * wp.max(wp.dot(normal, key), 0.0)
    side = 0.13 * openness * wp.max(wp.dot(normal, fill), 0.0)
    edge = wp.pow(1.0 - wp.clamp(wp.dot(normal, view), 0.0, 1.0), 3.0)
    back = 0.25 * openness * edge * wp.max(wp.dot(normal, rim), 0.0)
    middle = wp.normalize(key + view)
    shine = 0.10 * light * wp.pow(wp.max(wp.dot(normal, middle), 0.0), 40.0)
    sheen = 0.05 * openness * edge
    white = wp.vec3(1.0, 1.0, 1.0)
    warm = wp.vec3(1.03, 1.0, 0.96)
    cool = wp.vec3(0.96, 0.99, 1.04)
    return wp.cw_mul(albedo, (ambient + side) * cool + direct * warm + back * white) + (shine + sheen) * white


@wp.kernel
def fill_background_kernel(
    first: int,
    width: int,
    height: int,
    top: wp.vec3,
    bottom: wp.vec3,
    # outputs
    out_color: wp.array[wp.vec3],
):
    """The background, lighter towards the top."""
    r = first + wp.tid()
    _column, row = pixel_of_ray(r, (width + TILE_C - 1) / TILE_C)
    share = wp.clamp(float(row) / float(height), 0.0, 1.0)
    share = share * share * (3.0 - 2.0 * share)
    out_color[r] = (1.0 - share) * top + share * bottom


@wp.kernel
def shade_surface_kernel(
    first: int,
    ids: wp.array[int],
    direction: wp.array[wp.vec3],
    normal: wp.array[wp.vec3],
    albedo: wp.array[wp.vec3],
    light: wp.array[float],
    openness: wp.array[float],
    key: wp.vec3,
    fill: wp.vec3,
    rim: wp.vec3,
    up: wp.vec3,
    # outputs
    out_color: wp.array[wp.vec3],
):
    """The colour of one hit."""
    i = first + wp.tid()
    r = ids[i]
    out_color[r] = lit(albedo[i], normal[i], -direction[r], key, fill, rim, up, light[i], openness[i])


@wp.kernel
def shade_ground_kernel(
    first: int,
    ids: wp.array[int],
    origin: wp.array[wp.vec3],
    light: wp.array[float],
    openness: wp.array[float],
    middle: wp.vec3,
    radius: float,
    darkness: float,
    # outputs, read too
    out_color: wp.array[wp.vec3],
):
    """The ground is the background, darker where there is shadow; it fades out at `radius`."""
    i = first + wp.tid()
    away = wp.length(origin[i] - middle) / radius
    fade = wp.clamp(2.0 * (1.0 - away), 0.0, 1.0)
    fade = fade * fade * (3.0 - 2.0 * fade)
    shade = 1.0 - (0.45 + 0.55 * light[i]) * (0.35 + 0.65 * openness[i])
    r = ids[i]
    out_color[r] = (1.0 - darkness * fade * shade) * out_color[r]


@wp.kernel
def develop_kernel(
    first: int,
    color: wp.array[wp.vec3],
    width: int,
    samples: int,
    # outputs
    out_pixels: wp.array[wp.uint8],
):
    """Bytes of one pixel of the picture: the mean of samples x samples rays, averaged as shown."""
    i = first + wp.tid()
    row = i / width
    column = i - row * width
    tiles_x = (width * samples + TILE_C - 1) / TILE_C
    total = wp.vec3()
    for v in range(samples):
        for u in range(samples):
            x = column * samples + u
            y = row * samples + v
            tile = (y / TILE_C) * tiles_x + x / TILE_C
            c = color[tile * TILE_C * TILE_C + (y % TILE_C) * TILE_C + x % TILE_C]
            total += wp.vec3(displayed(c[0]), displayed(c[1]), displayed(c[2]))
    total = total * (255.0 / float(samples * samples))
    for channel in range(3):
        out_pixels[3 * i + channel] = wp.uint8(wp.clamp(total[channel] + 0.5, 0.0, 255.0))


def background(count: int, width: int, height: int, device: wp.Device) -> wp.array:
    """Linear colours (count,) of all rays before anything is hit."""
    color = wp.empty(count, dtype=wp.vec3, device=device)
    top, bottom = (
        wp.vec3(*(float(c) for c in to_linear(np.array(shown))))
        for shown in (BACKGROUND_TOP, BACKGROUND_BOTTOM)
    )
    launch(
        fill_background_kernel, count, [width, height, top, bottom], [color], device, seconds_per_thread=5e-9
    )
    return color


def develop(color: wp.array, width: int, height: int, samples: int) -> np.ndarray:
    """Picture (height, width, 3) uint8 sRGB from the colours of its samples^2 times as many rays."""
    device = color.device
    pixels = wp.empty(width * height * 3, dtype=wp.uint8, device=device)
    launch(
        develop_kernel,
        width * height,
        [color, width, samples],
        [pixels],
        device,
        seconds_per_thread=6e-8 * samples * samples,
    )
    return pixels.numpy().reshape(height, width, 3).copy()
