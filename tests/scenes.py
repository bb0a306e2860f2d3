"""Random and chosen primitives that several tests share."""

from __future__ import annotations

import json
import lzma
from pathlib import Path

import numpy as np

from resfit.kernels.primitives import FAMILIES
from resfit.kernels.rows import BLEND, ROTATION, SHAPES, empty_rows


def vectors(name: str) -> list[dict]:
    """Float64 test vectors called `name`: "superfrustum" or "smooth_union"."""
    packed = (Path(__file__).parent / "data" / f"{name}_vectors.json.xz").read_bytes()
    return json.loads(lzma.decompress(packed))


def random_rotation(rng: np.random.Generator, count: int) -> np.ndarray:
    """Unit quaternions (count, 4)."""
    q = rng.normal(size=(count, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def random_rows(rng: np.random.Generator, families: list[str]) -> np.ndarray:
    """Rows of tame primitives in [-1, 1]^3: sizes 0.1 .. 0.6, every other parameter over its legal range."""
    rows = empty_rows(len(families))
    rows[:, :3] = rng.uniform(-0.6, 0.6, (len(rows), 3))
    rows[:, ROTATION : ROTATION + 4] = random_rotation(rng, len(rows))
    rows[:, BLEND] = rng.uniform(0.0, 0.1, len(rows))
    for row, name in zip(rows, families, strict=True):
        low, high = FAMILIES[name].legal_range
        shape = rng.uniform(low, np.minimum(high, 2.0))
        shape[:3] = rng.uniform(0.1, 0.6, 3)
        for parameter in FAMILIES[name].parameters:
            if parameter.name == "dilation":
                shape[FAMILIES[name].columns("dilation")] = rng.uniform(0.0, 0.05)
            if parameter.name == "exponents":
                shape[FAMILIES[name].columns("exponents")] = rng.uniform(0.3, 1.7, 2)
        row[SHAPES:BLEND] = shape
    return rows


DEGENERATE_SHAPES = [
    (0.4, 0.6, 0.8, 0.3, 0.02, 0.7, bulge, 0.2) for bulge in (0.0, 1e-8, -1e-8, 1e-5, 1e-3, 1.0, -1.0)
]
DEGENERATE_SHAPES += [(0.4, 0.6, 0.8, 0.3, 0.0, 0.7, 0.4, onion) for onion in (-1.0, 0.0, 1.0)]
DEGENERATE_SHAPES += [(0.4, 0.6, 0.8, 0.3, 0.0, taper, 0.4, -1.0) for taper in (0.0, 1.0, 2.0)]
DEGENERATE_SHAPES += [(0.4, 0.6, 0.8, roundness, 0.0, 1.0, 0.4, -1.0) for roundness in (0.0, 1.0)]
DEGENERATE_SHAPES += [
    (0.0, 0.0, 0.0, 0.0, 0.4, 1.0, 0.0, -1.0),
    (0.0, 0.0, 0.8, 0.0, 0.2, 1.0, 0.0, -1.0),
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
    (0.0, 0.0, 0.8, 0.0, 0.1, 1.0, 1.0, -1.0),
    (0.8, 0.8, 0.0, 1.0, 0.1, 1.0, 0.0, 1.0),
    (0.8, 0.8, 0.0, 1.0, 0.1, 1.0, 1.0, 1.0),
    (0.0, 0.5, 0.8, 1.0, 0.0, 2.0, -1.0, 1.0),
    (0.5, 0.0, 0.8, 1.0, 0.0, 0.0, -1.0, 0.5),
    (0.5, 0.5, 1e-4, 1.0, 0.0, 0.5, 0.7, 0.5),
    (0.3, 0.3, 0.8, 0.5, 0.01, 0.7, 0.5, 0.0),
    (5.0, 5.0, 5.0, 0.5, 1.0, 2.0, 1.0, -1.0),
]
"""SuperFrustum shapes at every edge of the legal ranges."""


def special_points(shape: tuple[float, ...]) -> np.ndarray:
    """Local points (n, 3) where the formulas are delicate: centre, axes, corners, faces, the arc centre, behind it."""
    size = np.array(shape[:3]) / 2
    signs = np.array(np.meshgrid([-1, 0, 1], [-1, 0, 1], [-1, 0, 1])).reshape(3, -1).T
    points = [signs * size, signs * 0.5 * size, signs * 1.5 * size, signs * 1.0]
    theta = shape[6] * np.pi / 2
    if abs(theta) > 1e-3:
        centre = np.array([size[2] / np.tan(theta), 0.0, 0.0])
        points += [centre + 1e-3 * signs, centre + 0.3 * signs, np.array([[centre[0], 0.0, 0.0]])]
        # The tie |S| = C of the two forms of the angle.
        t = np.linspace(-1, 1, 9)
        points.append(np.stack([centre[0] - t, np.zeros(9), t], 1))
    return np.concatenate(points)
