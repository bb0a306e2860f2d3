"""A pinhole camera, and its rays in the order that field kernels like: 8 x 8 pixels a block."""

# No postponed annotations here: Warp reads the kernels' own.

import math
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..runtime.launch import PLAIN_OPTIONS, launch

wp.set_module_options(PLAIN_OPTIONS)

TILE = 8
"""Side of the squares of pixels whose rays stand together: TILE^2 is a block of points."""
TILE_C = wp.constant(TILE)

Vector = tuple[float, float, float]
UP_AXES: dict[str, Vector] = {"y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
"""What points up: y in glTF, z in CAD. A model's front looks along +z where y is up, along -y where z is."""


@dataclass(frozen=True)
class Camera:
    """A right-handed pinhole camera; the picture's upper edge is towards `up`.

    Raises:
        ValueError: if there is no direction to look in: position and target coincide, `up` lies along the view, the
            field of view is not between 0 and 180 degrees, or a number is not finite.
    """

    position: Vector
    target: Vector = (0.0, 0.0, 0.0)
    up: Vector = UP_AXES["y"]
    field_of_view: float = 30.0
    """Vertical, in degrees."""

    def __post_init__(self) -> None:
        if not np.isfinite([*self.position, *self.target, *self.up, self.field_of_view]).all():
            raise ValueError("the camera's position, target, up and field of view must be finite numbers")
        if not 0.0 < self.field_of_view < 180.0:
            raise ValueError(
                f"the camera's field of view is {self.field_of_view}; it must be within 0 to 180 degrees"
            )
        view = np.subtract(self.target, self.position)
        if not np.linalg.norm(view) > 1e-9:
            raise ValueError("the camera's position and target coincide: there is no direction to look in")
        across = np.linalg.norm(np.cross(view, self.up))
        if not across > 1e-6 * np.linalg.norm(view) * np.linalg.norm(self.up):
            raise ValueError("the camera's up direction is zero or lies along the view")

    @property
    def axes(self) -> np.ndarray:
        """Unit vectors (3, 3): to the right, up and forward in the picture."""
        forward = np.subtract(self.target, self.position)
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, self.up)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(right, forward), forward])


def frame_bounds(
    lower: np.ndarray,
    upper: np.ndarray,
    up: str = "y",
    azimuth: float = 35.0,
    elevation: float = 22.0,
    aspect: float = 4.0 / 3.0,
    field_of_view: float = 30.0,
) -> Camera:
    """A camera that sees a box from three quarters, filling the picture.

    Args:
        lower, upper: corners of the box, (3,) each; a box without extent is seen from a distance of one.
        up: "y" or "z".
        azimuth: degrees from the model's front towards its left (the viewer's right).
        elevation: degrees above the horizon, below 90 in size.
        aspect: width of the picture by its height.
        field_of_view: vertical, in degrees.

    Raises:
        ValueError: if a value is out of its range.
    """
    if up not in UP_AXES:
        raise ValueError(f"up is '{up}'; it must be y or z")
    if not abs(elevation) < 90.0:
        raise ValueError(f"the elevation is {elevation} degrees; it must be within -90 to 90")
    if not aspect > 0.0:
        raise ValueError(f"the aspect is {aspect}; it must be above 0")
    lower, upper = np.asarray(lower, np.float64), np.asarray(upper, np.float64)
    turn, lift = math.radians(azimuth), math.radians(elevation)
    side, front, top = math.cos(lift) * math.sin(turn), math.cos(lift) * math.cos(turn), math.sin(lift)
    towards = np.array([side, top, front] if up == "y" else [side, -front, top])
    middle = 0.5 * (lower + upper)
    axes = Camera(_vector(towards), up=UP_AXES[up], field_of_view=field_of_view).axes
    corners = np.array([[(lower, upper)[bits >> axis & 1][axis] for axis in range(3)] for bits in range(8)])
    x, y, depth = ((corners - middle) @ axes.T).T
    slope = math.tan(math.radians(0.5 * field_of_view))
    distance = max((np.abs(y) / slope - depth).max(), (np.abs(x) / (slope * aspect) - depth).max())
    distance = 1.06 * float(distance) if distance > 1e-6 else 1.0
    return Camera(_vector(middle + distance * towards), _vector(middle), UP_AXES[up], field_of_view)


def _vector(values: np.ndarray) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z


@dataclass(frozen=True)
class Rays:
    """Rays on a device, in world coordinates of the scene."""

    origin: wp.array
    """(n,) vec3."""
    direction: wp.array
    """(n,) vec3 of length 1."""

    @property
    def count(self) -> int:
        """Number of rays, padding included."""
        return self.origin.shape[0]

    @property
    def device(self) -> wp.Device:
        """Device of the rays."""
        return self.origin.device


@wp.func
def pixel_of_ray(r: int, tiles_x: int):
    """Column and row of the pixel of a ray."""
    tile = r / (TILE_C * TILE_C)
    rest = r - tile * (TILE_C * TILE_C)
    row = tile / tiles_x
    return (tile - row * tiles_x) * TILE_C + rest % TILE_C, row * TILE_C + rest / TILE_C


@wp.kernel
def cast_camera_kernel(
    first: int,
    position: wp.vec3,
    right: wp.vec3,
    up: wp.vec3,
    forward: wp.vec3,
    width: int,
    height: int,
    slope: float,
    # outputs
    out_origin: wp.array[wp.vec3],
    out_direction: wp.array[wp.vec3],
):
    """The ray through the middle of one pixel; row 0 is the picture's upper edge."""
    r = first + wp.tid()
    column, row = pixel_of_ray(r, (width + TILE_C - 1) / TILE_C)
    scale = 2.0 * slope / float(height)
    x = (float(column) + 0.5 - 0.5 * float(width)) * scale
    y = (0.5 * float(height) - float(row) - 0.5) * scale
    out_origin[r] = position
    out_direction[r] = wp.normalize(forward + x * right + y * up)


def tile_counts(width: int, height: int) -> tuple[int, int]:
    """Tiles along both sides of a picture, the last ones possibly sticking out."""
    return -(-width // TILE), -(-height // TILE)


def camera_rays(camera: Camera, width: int, height: int, device: wp.Device) -> Rays:
    """A ray per pixel, tile by tile; tiles that stick out of the picture have rays all the same."""
    across, down = tile_counts(width, height)
    count = across * down * TILE * TILE
    right, up, forward = (wp.vec3(*_vector(axis)) for axis in camera.axes)
    slope = math.tan(math.radians(0.5 * camera.field_of_view))
    rays = Rays(wp.empty(count, dtype=wp.vec3, device=device), wp.empty(count, dtype=wp.vec3, device=device))
    launch(
        cast_camera_kernel,
        count,
        [wp.vec3(*camera.position), right, up, forward, width, height, slope],
        [rays.origin, rays.direction],
        device,
        seconds_per_thread=1e-8,
    )
    return rays
