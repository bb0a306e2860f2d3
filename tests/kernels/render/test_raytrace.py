"""Pictures without OpenGL: what stands where in them, compared with projections computed by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import warp as wp

from resfit.kernels.contour.isosurface import extract_isosurface, tight_bounds
from resfit.kernels.field.evaluate import evaluate_assembly
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.primitives import family
from resfit.kernels.render.camera import Camera, camera_rays, frame_bounds
from resfit.kernels.render.raytrace import render_assembly, render_mesh
from resfit.kernels.render.sphere_trace import Box, march_rays
from resfit.kernels.rows import BLEND, ROTATION, SHAPE, SHAPES, TRANSLATION, empty_rows
from resfit.kernels.runtime.launch import profiled

WIDTH, HEIGHT = 120, 90
RED, BLUE = (0.9, 0.05, 0.05), (0.05, 0.05, 0.9)


def assembly(
    device: wp.Device, *items: tuple[str, dict[str, Any], tuple[float, float, float]]
) -> PrimitiveSet:
    """Primitives (family, parameters, position), unturned."""
    rows = empty_rows(len(items))
    for row, (name, parameters, position) in zip(rows, items, strict=True):
        row[SHAPES : SHAPES + SHAPE] = family(name).shape_row(**parameters)
        row[TRANSLATION : TRANSLATION + 3] = position
    return PrimitiveSet(rows, [name for name, _, _ in items], device)


def ball(device: wp.Device, radius: float = 0.5) -> PrimitiveSet:
    return assembly(device, ("superfrustum", {"size": (0, 0, 0), "dilation": radius}, (0, 0, 0)))


def pixel_directions(camera: Camera, width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
    """Unit vectors (height, width, 3) through the pixels, computed here."""
    slope = math.tan(math.radians(camera.field_of_view / 2))
    y, x = np.mgrid[:height, :width]
    right, up, forward = camera.axes
    x = (2 * (x + 0.5) - width) / height * slope
    y = (height - 2 * (y + 0.5)) / height * slope
    rays = forward + x[..., None] * right + y[..., None] * up
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def silhouette(picture: np.ndarray) -> np.ndarray:
    """Pixels (height, width) that show a saturated colour: the studio is all grey."""
    return np.ptp(picture.astype(int), axis=2) > 25


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    """Intersection over union of two masks."""
    return float((a & b).sum() / (a | b).sum())


def picture(primitives: PrimitiveSet, camera: Camera, **options: Any) -> np.ndarray:
    options = {"samples": 1, "width": WIDTH, "height": HEIGHT} | options
    return render_assembly(primitives, np.tile(RED, (len(primitives), 1)), camera, **options)


@pytest.mark.parametrize("up", ["y", "z"])
def test_ball_is_where_it_should_be(device: wp.Device, up: str) -> None:
    camera = frame_bounds(np.full(3, -0.5), np.full(3, 0.5), up)
    rays = pixel_directions(camera)
    centre = -np.array(camera.position)
    clearance = np.linalg.norm(centre - (rays @ centre)[..., None] * rays, axis=-1)
    assert overlap(silhouette(picture(ball(device), camera)), clearance < 0.5) > 0.98


def test_box_is_where_it_should_be(device: wp.Device) -> None:
    size = np.array([0.9, 0.5, 0.3])
    camera = frame_bounds(-0.5 * size, 0.5 * size, azimuth=-50.0)
    rays, eye = pixel_directions(camera), np.array(camera.position)
    one, other = (-0.5 * size - eye) / rays, (0.5 * size - eye) / rays
    expected = np.minimum(one, other).max(axis=-1) < np.maximum(one, other).min(axis=-1)
    shown = picture(assembly(device, ("cuboid", {"size": size}, (0, 0, 0))), camera)
    assert overlap(silhouette(shown), expected) > 0.98


def mixed_assembly(device: wp.Device) -> PrimitiveSet:
    """Bent, hollow, blended and approximate primitives together."""
    primitives = assembly(
        device,
        ("superfrustum", {"size": (0.15, 0.3, 1), "bulge": 0.9}, (-0.2, 0.1, 0)),
        ("superfrustum", {"size": (0.6, 0.6, 0.5), "roundness": 1, "onion": 0.8}, (0.4, 0.3, 0)),
        ("superfrustum", {"size": (0.5, 0.5, 0.6), "roundness": 1, "taper": 0}, (0.2, -0.3, 0.3)),
        ("superquadric", {"size": (0.8, 0.05, 0.8), "exponents": (1, 0.3)}, (0, -0.5, 0)),
    )
    rows = primitives.rows_numpy()
    rows[:, BLEND] = 0.1
    rows[1, ROTATION : ROTATION + 4] = 0.8, 0.3, -0.4, 0.25
    primitives.set_rows(rows)
    return primitives


def test_tracing_agrees_with_the_field_along_rays(device: wp.Device) -> None:
    primitives = mixed_assembly(device)
    camera = frame_bounds(*tight_bounds(primitives))
    rays, eye = pixel_directions(camera), np.array(camera.position)
    along = np.linalg.norm(eye - camera.target) + np.linspace(-1.2, 1.2, 500)
    points = eye + along[:, None, None, None] * rays
    field = evaluate_assembly(primitives, points.reshape(-1, 3)).reshape(len(along), HEIGHT, WIDTH)
    assert overlap(silhouette(picture(primitives, camera)), field.min(axis=0) < 0.0) > 0.98


def test_mesh_and_field_look_alike(device: wp.Device) -> None:
    primitives = mixed_assembly(device)
    camera = frame_bounds(*tight_bounds(primitives))
    vertices, faces = extract_isosurface(primitives, 96)
    options: dict[str, Any] = {"width": WIDTH, "height": HEIGHT, "samples": 1, "device": device}
    from_mesh = render_mesh(vertices, faces, camera, color=RED, **options)
    from_field = picture(primitives, camera)
    assert overlap(silhouette(from_mesh), silhouette(from_field)) > 0.98
    assert np.abs(from_mesh.astype(int) - from_field).mean() < 6.0


def test_hits_are_on_the_surface(device: wp.Device) -> None:
    camera = Camera((0.3, 0.4, 2.0))
    rays = camera_rays(camera, 64, 48, device)
    box = Box(wp.vec3(-0.6, -0.6, -0.6), wp.vec3(0.6, 0.6, 0.6))
    distance = march_rays(ball(device), rays, box, 1e-4).numpy()
    points = rays.origin.numpy() + distance[:, None] * rays.direction.numpy()
    hit = distance < 10.0
    assert 300 < hit.sum() < 2000
    np.testing.assert_allclose(np.linalg.norm(points[hit], axis=1), 0.5, atol=4e-4)


def test_parts_have_their_colours(device: wp.Device) -> None:
    size = {"size": (0.4, 0.4, 0.4)}
    primitives = assembly(device, ("cuboid", size, (-0.4, 0, 0)), ("cuboid", size, (0.4, 0, 0)))
    camera = Camera((0.0, 0.0, 4.0))
    shown = render_assembly(primitives, np.array([RED, BLUE]), camera, WIDTH, HEIGHT).astype(int)
    assert shown.shape == (HEIGHT, WIDTH, 3)
    left, right = shown[HEIGHT // 2, 45], shown[HEIGHT // 2, 75]
    assert left[0] > left[2] + 80
    assert right[2] > right[0] + 80


def test_ground_catches_a_shadow(device: wp.Device) -> None:
    camera = frame_bounds(np.full(3, -0.5), np.full(3, 0.5))
    without = picture(ball(device), camera, ground=False).astype(int)
    shaded = picture(ball(device), camera).astype(int)
    darker = (without - shaded).max(axis=2)
    assert darker.max() > 30
    assert darker[: HEIGHT // 4].max() == 0
    # The object itself is the same.
    assert (darker[silhouette(without)] == 0).mean() > 0.98


def test_nothing_shows_the_background(device: wp.Device) -> None:
    camera = Camera((0.0, 0.0, 3.0))
    empty = picture(PrimitiveSet(empty_rows(0), [], device), camera)
    assert empty.dtype == np.uint8 and empty.min() > 200
    assert np.ptp(empty, axis=1).max() == 0
    no_faces = np.zeros((0, 3), int)
    bare = render_mesh(np.zeros((0, 3)), no_faces, camera, WIDTH, HEIGHT, samples=1, device=device)
    np.testing.assert_array_equal(bare, empty)


def test_size_need_be_no_multiple_of_a_tile(device: wp.Device) -> None:
    camera = Camera((0.0, 0.0, 3.0))
    large = picture(ball(device), camera, width=64, height=48, ground=False)
    odd = picture(ball(device), camera, width=61, height=48, ground=False)
    assert odd.shape == (48, 61, 3)
    # One column and a half less on each side.
    assert silhouette(odd).sum() == pytest.approx(silhouette(large).sum(), rel=0.02)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"position": (1, 2, 3), "target": (1, 2, 3)}, "coincide"),
        ({"position": (0, 3, 0)}, "up direction"),
        ({"position": (0, 0, 3), "up": (0, 0, 0)}, "up direction"),
        ({"position": (0, 0, 3), "field_of_view": 0.0}, "field of view"),
        ({"position": (0, 0, 3), "field_of_view": 180.0}, "field of view"),
        ({"position": (0, math.nan, 3)}, "finite"),
    ],
)
def test_degenerate_camera_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Camera(**options)


def test_impossible_views_and_pictures_are_refused(device: wp.Device) -> None:
    corner = np.ones(3)
    for options in ({"up": "x"}, {"elevation": 90.0}, {"aspect": 0.0}):
        with pytest.raises(ValueError):
            frame_bounds(-corner, corner, **options)
    camera = Camera((0.0, 0.0, 3.0))
    with pytest.raises(ValueError, match="pixels"):
        picture(ball(device), camera, width=0)
    with pytest.raises(ValueError, match="1 primitives but 2 colours"):
        render_assembly(ball(device), np.array([RED, BLUE]), camera)


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("azimuth", [0.0, 35.0, 200.0])
def test_framed_box_fills_the_picture(up: str, azimuth: float) -> None:
    low, high = np.array([-0.2, 0.1, -0.7]), np.array([0.6, 0.4, 0.9])
    camera = frame_bounds(low, high, up, azimuth)
    right, above, forward = camera.axes
    corners = np.array([[(low, high)[b >> a & 1][a] for a in range(3)] for b in range(8)]) - camera.position
    slope = math.tan(math.radians(camera.field_of_view / 2))
    x = corners @ right / (corners @ forward) / (slope * 4 / 3)
    y = corners @ above / (corners @ forward) / slope
    assert 0.8 < max(np.abs(x).max(), np.abs(y).max()) < 1.0
    np.testing.assert_allclose(np.cross(right, above), -forward, atol=1e-12)
    if azimuth == 0.0:
        # A front view: x to the right, in both conventions.
        np.testing.assert_allclose(right, (1.0, 0.0, 0.0), atol=1e-12)


def test_in_a_crowd_nobody_asks_what_is_around(rng: np.random.Generator, device: wp.Device) -> None:
    camera = frame_bounds(np.full(3, -0.9), np.full(3, 0.9))
    for count, asked in ((50, True), (1500, False)):
        corners = rng.uniform(-0.9, 0.9, (3 * count, 3))
        faces = np.arange(3 * count).reshape(-1, 3)
        with profiled() as usage:
            picture = render_mesh(corners, faces, camera, 24, 18, device=device)
        assert ("open_mesh_kernel" in usage) == asked
        assert picture.std() > 5.0
