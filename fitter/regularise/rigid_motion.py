"""Moving primitives: scaled into another frame, turned, and mirrored. Rows are those of `kernels/rows.py`.

Quaternions are (w, x, y, z), local to world. Products with axis-aligned ones only permute and negate numbers, so that
mirrored and copied parts are equal to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ...kernels.primitives import family
from ...kernels.rows import BLEND, ROTATION, SHAPE, SHAPES, TRANSLATION

HALF_TURN_Y = np.array([0.0, 0.0, 1.0, 0.0])
"""Half a turn about the local y axis: with it a reflection becomes a rotation, since every family is its own mirror
image in the plane y = 0."""


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Products (..., 4) of quaternions: first b, then a."""
    aw, ax, ay, az = np.moveaxis(np.asarray(a, np.float64), -1, 0)
    bw, bx, by, bz = np.moveaxis(np.asarray(b, np.float64), -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def matrix_of(quaternion: np.ndarray) -> np.ndarray:
    """The rotation (3, 3) float64 of one quaternion."""
    w, x, y, z = np.asarray(quaternion, np.float64) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of(matrix: np.ndarray) -> np.ndarray:
    """The quaternion (4,) of a rotation (3, 3), its largest number positive."""
    m = np.asarray(matrix, np.float64)
    symmetric = np.array(
        [
            [m[0, 0] + m[1, 1] + m[2, 2], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
            [0.0, m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]],
            [0.0, 0.0, m[1, 1] - m[0, 0] - m[2, 2], m[1, 2] + m[2, 1]],
            [0.0, 0.0, 0.0, m[2, 2] - m[0, 0] - m[1, 1]],
        ]
    )
    quaternion = np.linalg.eigh(symmetric, UPLO="U")[1][:, -1]
    # Turns about the axes come out exact, so that what they move is moved without rounding.
    whole = np.round(quaternion)
    return canonical_sign(np.where(np.abs(quaternion - whole) < 1e-12, whole, quaternion))


def canonical_sign(quaternion: np.ndarray) -> np.ndarray:
    """Of q and -q, which are the same rotation, the one whose first number of notable size is positive."""
    leading = quaternion[np.flatnonzero(np.abs(quaternion) > 1e-3)[0]]
    return quaternion if leading > 0 else -quaternion


def rescale_rows(
    rows: np.ndarray, families: Sequence[str], scale: float, offset: Sequence[float] | np.ndarray
) -> np.ndarray:
    """Rows in a frame where a point p of theirs is at scale * p + offset; (primitive_count, ROW) float32."""
    moved = rows.astype(np.float64)
    place = slice(TRANSLATION, TRANSLATION + 3)
    moved[:, place] = moved[:, place] * scale + np.asarray(offset, np.float64)
    moved[:, BLEND] *= scale
    shapes = moved[:, SHAPES : SHAPES + SHAPE]
    for row, name in enumerate(families):
        shapes[row, family(name).lengths] *= scale
    return moved.astype(np.float32)


def move_rows(rows: np.ndarray, turn: np.ndarray, centre: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Rows turned about a centre and shifted: p becomes turn (p - centre) + centre + shift.

    Args:
        rows: (primitive_count, ROW).
        turn: orthogonal matrix (3, 3); one with determinant -1 mirrors.
        centre, shift: (3,).
    """
    moved = rows.astype(np.float64)
    place = slice(TRANSLATION, TRANSLATION + 3)
    moved[:, place] = (moved[:, place] - centre) @ turn.T + centre + shift
    quaternions = moved[:, ROTATION : ROTATION + 4]
    quaternion, mirrored = _turn(np.ascontiguousarray(turn, np.float64).tobytes())
    turned = multiply(quaternion, quaternions)
    if mirrored:
        turned = multiply(turned, HALF_TURN_Y)
    for row, quaternion in enumerate(turned):
        moved[row, ROTATION : ROTATION + 4] = canonical_sign(quaternion)
    return moved.astype(np.float32)


@lru_cache(maxsize=1024)
def _turn(matrix: bytes) -> tuple[np.ndarray, bool]:
    """The quaternion of an orthogonal matrix, its sign changed where it mirrors, and whether it does."""
    turn = np.frombuffer(matrix).reshape(3, 3)
    mirrored = bool(np.linalg.det(turn) < 0)
    return quaternion_of(-turn if mirrored else turn), mirrored
