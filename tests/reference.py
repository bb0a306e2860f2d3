"""Float64 references in plain NumPy, written from the formulas and not from the kernels."""

from __future__ import annotations

import numpy as np


def rotation_matrix(quaternion: np.ndarray) -> np.ndarray:
    """Local to world (3, 3) of a quaternion (w, x, y, z) of any length."""
    w, x, y, z = np.asarray(quaternion, np.float64) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _straight(x, y, z, size, roundness, taper, onion):
    """Undilated distance at straightened points: rounded rectangle, then the trapezoid of its inset and height."""
    h, m = size[2] / 2, min(size[0], size[1]) / 2
    radius = roundness * m
    q = np.stack([np.abs(x) - size[0] / 2 + radius, np.abs(y) - size[1] / 2 + radius])
    both = np.linalg.norm(np.maximum(q, 0), axis=0)
    u = np.where((q > 0).all(0), both, q.max(0)) - radius
    corners = np.array([[(onion - 1) * m, -h], [0, -h], [(taper - 1) * m, h], [(onion * taper - 1) * m, h]])
    p = np.stack([u, z], -1)
    deepest, nearest = np.full(u.shape, -np.inf), np.full(u.shape, np.inf)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        edge = b - a
        length = max(np.hypot(*edge), 1e-18)
        share = np.clip(((p - a) @ edge) / length**2, 0, 1)
        nearest = np.minimum(nearest, np.linalg.norm(p - a - share[..., None] * edge, axis=-1))
        if length > 1e-15:
            deepest = np.maximum(deepest, ((p - a) @ np.array([edge[1], -edge[0]])) / length)
    return np.where(deepest < 0, deepest, nearest)


def superfrustum(points: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Signed distance of local points (n, 3) by the formulas of docs/superfrustum.md; shape (8,) in row order."""
    x, y, z = np.asarray(points, np.float64).T
    size, (roundness, dilation, taper, bulge, onion) = np.maximum(shape[:3], 1e-6), shape[3:8]
    h, theta = size[2] / 2, bulge * np.pi / 2
    if abs(theta) < 1e-9:
        return _straight(-x, y, z, size, roundness, taper, onion) - dilation
    if theta < 0:
        x, theta = -x, -theta
    centre = h / np.tan(theta)
    phi = np.arctan2(z, centre - x)
    clamped = np.clip(phi, -theta, theta)
    radius = np.hypot(x - centre, z)
    sx = radius * np.cos(phi - clamped) - h / np.sin(theta)
    sz = h * clamped / theta + radius * np.sin(phi - clamped)
    near = _straight(sx, y, sz, size, roundness, taper, onion)
    end = np.where(phi >= 0, -theta, theta)
    ox = radius * np.cos(phi - end) - h / np.sin(theta)
    oz = h * end / theta + radius * np.sin(phi - end)
    other = _straight(ox, y, oz, size, roundness, taper, onion)
    start = max(theta, np.pi - theta)
    weight = np.clip((np.abs(phi) - start) / (np.pi - start), 0, 1)
    return near + weight * (np.minimum(near, other) - near) - dilation


def cuboid(points: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Signed distance of local points (n, 3) to a box of full extents shape[:3]."""
    q = np.abs(np.asarray(points, np.float64)) - np.asarray(shape[:3], np.float64) / 2
    return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(1), 0)


def superprimitive(points: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Signed distance of local points (n, 3): size (3), roundness, dilation, onion."""
    return superfrustum(points, np.array([*shape[:5], 1.0, 0.0, shape[5]]))


def superquadric(points: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Radial approximate distance of local points (n, 3): size (3), two exponents."""
    p = np.asarray(points, np.float64)
    q = np.abs(p) / (np.asarray(shape[:3], np.float64) / 2)
    e1, e2 = shape[3], shape[4]
    inside_outside = (q[:, 0] ** (2 / e2) + q[:, 1] ** (2 / e2)) ** (e2 / e1) + q[:, 2] ** (2 / e1)
    return np.linalg.norm(p, axis=1) * (1 - inside_outside ** (-e1 / 2))


FIELDS = {
    "cuboid": cuboid,
    "superfrustum": superfrustum,
    "superprimitive": superprimitive,
    "superquadric": superquadric,
}


def primitive(points: np.ndarray, row: np.ndarray, family: str) -> np.ndarray:
    """Signed distance of world points (n, 3) to one row, ungated."""
    local = (np.asarray(points, np.float64) - row[:3]) @ rotation_matrix(row[3:7])
    return FIELDS[family](local, np.asarray(row[7:15], np.float64))


def smooth_minimum(a: np.ndarray, b: np.ndarray, blend: float) -> np.ndarray:
    """Quadratic smooth minimum; the hard one at blend 0."""
    if blend <= 0:
        return np.minimum(a, b)
    return np.minimum(a, b) - np.maximum(blend - np.abs(a - b), 0) ** 2 / (4 * blend)


def union(points: np.ndarray, rows: np.ndarray, families: list[str]) -> np.ndarray:
    """Smooth union of gated primitives, folded left in list order; the first blend is unused."""
    field = None
    for row, family in zip(np.asarray(rows, np.float64), families, strict=True):
        value = row[16] * primitive(points, row, family) + 1 - row[16]
        field = value if field is None else smooth_minimum(field, value, row[15])
    assert field is not None
    return field
