"""Each family's GLSL text against its Warp field, in a real headless Chromium with WebGL 2."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from glsl_page import EVALUATE, encoded

from resfit.kernels.field.combine import DIFFERENCE, UNION, combined, combined_share
from resfit.kernels.field.combine import GLSL as COMBINE_GLSL
from resfit.kernels.field.evaluate import evaluate_primitives
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.primitives import FAMILIES
from resfit.kernels.rows import SHAPE, SHAPES, empty_rows
from resfit.kernels.runtime.launch import choose_device

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.browser

POINTS = 112
"""Points a shape is tried at."""
TOLERANCE = 1e-4
"""Largest difference, relative to the shape's extent where that is above 1. Float32 rounding is 1e-6."""


@pytest.fixture(scope="module")
def page(browser: Browser) -> Iterator[Page]:
    """One blank page for all families."""
    made = browser.new_page()
    yield made
    made.close()


def evaluate_in_browser(
    page: Page, name: str, glsl: str, shapes: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """Values (k, n) of the GLSL function `sdf_<name>` for shapes (k, SHAPE) at their own points (k, n, 3)."""
    padded = np.concatenate([points, np.zeros_like(points[..., :1])], axis=-1)
    arguments = [glsl, name, encoded(shapes), encoded(padded), *points.shape[:2]]
    result: dict[str, Any] = json.loads(json.dumps(page.evaluate(EVALUATE, arguments)))
    assert "error" not in result, result["error"]
    assert result["code"] == 0
    return np.array(result["values"], np.float64).reshape(points.shape[:2])


def evaluate_in_warp(name: str, shapes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The same by the Warp field: all shapes at all points, of which each keeps its own."""
    rows = empty_rows(len(shapes))
    rows[:, SHAPES : SHAPES + SHAPE] = shapes
    values = np.empty(points.shape[:2], np.float32)
    # A few shapes at a time: the full table of shapes by points would be large.
    for begin in range(0, len(shapes), 32):
        own = points[begin : begin + 32]
        primitives = PrimitiveSet(rows[begin : begin + 32], [name] * len(own), choose_device("cpu"))
        table = evaluate_primitives(primitives, own.reshape(-1, 3)).reshape(len(own), len(own), -1)
        values[begin : begin + 32] = table[np.arange(len(own)), np.arange(len(own))]
    return values


def random_shapes(name: str, count: int, rng: np.random.Generator) -> np.ndarray:
    """Legal shapes (count, SHAPE) of a family, some of their numbers at the ends of their ranges."""
    low, high = FAMILIES[name].legal_range
    high = np.where(np.isfinite(high), high, np.where(np.arange(SHAPE) < 3, 2.0, 0.3))
    shapes = rng.uniform(low, high, (count, SHAPE))
    edge = rng.random((count, SHAPE))
    shapes = np.where(edge < 0.04, low, np.where(edge > 0.96, high, shapes))
    # Sizes of every magnitude, and ties between them.
    shapes[:, :3] *= np.where(rng.random((count, 3)) < 0.3, rng.uniform(0.005, 0.2, (count, 3)), 1.0)
    ties = rng.random(count) < 0.3
    shapes[ties, 1] = shapes[ties, 0]
    return shapes.astype(np.float32)


SPECIAL: dict[str, list[dict[str, Any]]] = {
    "cuboid": [{"size": size} for size in ((0, 0, 0), (1, 0, 1), (1e-5, 1, 1), (2, 2, 2))],
    "superprimitive": [
        {"size": (0, 0, 0), "dilation": 0.4},
        {"size": (0, 0, 1), "dilation": 0.1},
        {"size": (1, 1, 0), "roundness": 1, "onion": 1, "dilation": 0.1},
        {"size": (1, 1, 1), "roundness": 1},
        {"size": (1, 1, 1), "onion": 0},
        {"size": (1, 0.5, 1), "onion": 0.97, "roundness": 0},
    ],
    "superquadric": [
        {"size": (1, 1, 1)},
        {"size": (0, 1, 1)},
        {"size": (1, 0.7, 0.4), "exponents": (0, 0)},
        {"size": (1, 0.7, 0.4), "exponents": (2, 2)},
        {"size": (1, 0.7, 0.4), "exponents": (0.05, 1.9)},
    ],
    "superfrustum": [
        {"size": size, "bulge": bulge, "onion": onion, "taper": taper, "roundness": roundness}
        for size in ((1, 1, 1), (0.3, 0.8, 1.2), (1.5, 0.4, 0.7), (1, 1, 1e-4), (0, 0, 1), (0.02, 1, 1))
        for bulge in (0, 1e-8, 1e-5, -1e-5, 1e-3, 0.02, -0.4, 1, -1)
        for onion, taper, roundness in ((-1, 1, 0), (0, 0, 1), (0.97, 2, 0.5), (0.5, 0, 0))
    ]
    + [
        {"size": (0, 0, 0), "dilation": 0.5},
        {"size": (0, 0, 1), "dilation": 0.2},
        {"size": (1, 1, 0), "roundness": 1, "onion": 1, "dilation": 0.15},
        {"size": (0, 0, 0), "onion": 1, "dilation": 0.1, "bulge": 1},
    ],
}


def special_shapes(name: str) -> np.ndarray:
    """The degenerate shapes of a family, (k, SHAPE)."""
    rows = [FAMILIES[name].shape_row(**entry) for entry in SPECIAL.get(name, [{}])]
    return np.array(rows, np.float32)


def sample_points(shapes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Local points (k, POINTS, 3): in and around each shape, and on planes and axes that are special."""
    extent = np.maximum(shapes[:, None, :3], 0.05)
    points = rng.uniform(-1.0, 1.0, (len(shapes), POINTS, 3)) * (0.3 + 0.8 * extent)
    points[:, :8, 2] = 0.0
    points[:, 8:12, 0] = 0.0
    points[:, 12:16, 1] = 0.0
    points[:, 16:20, :2] = 0.0
    points[:, 20:24, 1:] = 0.0
    points[:, 24] = 0.0
    points[:, 25] = 0.5 * shapes[:, :3]
    points[:, 26:28, 2] = 0.5 * shapes[:, 2:3]
    points[:, 28:32, 2] = -0.0
    return points.astype(np.float32)


def away_from_arc_centre(name: str, shapes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Where (k, n) the field is well-conditioned: at the centre of a bend's arc any rounding changes it."""
    if name != "superfrustum":
        return np.ones(points.shape[:2], bool)
    half = 0.5 * np.maximum(shapes[:, None, 2], 1e-6)
    theta = 0.5 * np.pi * shapes[:, None, 6]
    along = np.cos(theta) - np.sin(theta) * points[..., 0] / half
    return np.hypot(along, np.sin(theta) * points[..., 2] / half) > 1e-3


@pytest.mark.parametrize("name", sorted(FAMILIES))
def test_text_equals_field(name: str, page: Page, rng: np.random.Generator) -> None:
    shapes = np.concatenate([special_shapes(name), random_shapes(name, 256, rng)])
    points = sample_points(shapes, rng)
    in_browser, in_warp = (
        evaluate_in_browser(page, name, FAMILIES[name].glsl, shapes, points),
        evaluate_in_warp(name, shapes, points),
    )
    assert np.isfinite(in_browser).all()
    scale = np.maximum(1.0, np.maximum(np.abs(in_warp), shapes[:, None, :3].max(axis=-1)))
    difference = np.abs(in_browser - in_warp) / scale
    difference[~away_from_arc_centre(name, shapes, points)] = 0.0
    worst = np.unravel_index(difference.argmax(), difference.shape)
    assert difference[worst] < TOLERANCE, (shapes[worst[0]], points[worst], in_browser[worst], in_warp[worst])


@pytest.mark.parametrize("operation", [UNION, DIFFERENCE])
def test_combining_equals_its_twin(operation: float, page: Page, rng: np.random.Generator) -> None:
    wrapped = """
float sdf_value(vec3 p, float s[8]) { return combine(p.x, p.y, p.z, s[0]); }
float sdf_share(vec3 p, float s[8]) { return combine_share(p.x, p.y, p.z, s[0]); }
"""
    points = rng.uniform(-1.0, 1.0, (1, 4000, 3)).astype(np.float32)
    points[..., 2] = np.where(rng.random(4000) < 0.2, 0.0, np.abs(points[..., 2]))
    shapes = np.full((1, SHAPE), operation, np.float32)
    for name, twin in (("value", combined), ("share", combined_share)):
        found = evaluate_in_browser(page, name, COMBINE_GLSL + wrapped, shapes, points)[0]
        expected = [twin(a, b, float(blend), operation) for a, b, blend in points[0].astype(np.float64)]
        assert np.abs(found - expected).max() < 1e-5
