"""Moving primitives: turned, shifted and mirrored. Rows are those of `kernels/rows.py`."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ...kernels.rotation import multiply, quaternion_of
from ...kernels.rows import ROTATION, TRANSLATION

HALF_TURN_Y = np.array([0.0, 0.0, 1.0, 0.0])
"""Half a turn about the local y axis: with it a reflection becomes a rotation, since every family is its own mirror
image in the plane y = 0."""


def canonical_sign(quaternion: np.ndarray) -> np.ndarray:
    """Of q and -q, which are the same rotation, the one whose first number of notable size is positive."""
    leading = quaternion[np.flatnonzero(np.abs(quaternion) > 1e-3)[0]]
    return quaternion if leading > 0 else -quaternion


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
