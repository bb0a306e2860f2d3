"""Unit quaternions (w, x, y, z) and rotation matrices, local to world. SciPy loads at its first use."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def matrix_of(quaternions: npt.ArrayLike) -> np.ndarray:
    """Rotation matrices (..., 3, 3) float64 of quaternions (..., 4) of any length but 0.

    Their length is measured in their own precision: SciPy's, in float64, moves small coordinates of fits in the seventh
    digit.
    """
    quaternions = np.asarray(quaternions)
    unit = quaternions.astype(np.float64) / np.linalg.norm(quaternions, axis=-1, keepdims=True)
    w, x, y, z = np.moveaxis(unit, -1, 0)
    entries = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.ascontiguousarray(np.moveaxis(np.array(entries), (0, 1), (-2, -1)))


def quaternion_of(matrices: npt.ArrayLike) -> np.ndarray:
    """Unit quaternions (..., 4) float64 of rotation matrices (n, 3, 3) or (3, 3), their largest number positive.

    Those of turns about the axes by half a turn are exact.
    """
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(np.asarray(matrices, np.float64)).as_quat(scalar_first=True)


def rotation_about(axis: npt.ArrayLike, angle: float) -> np.ndarray:
    """The matrix (3, 3) of a rotation about a unit axis (3,), by radians."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(angle * np.asarray(axis, np.float64)).as_matrix()


def multiply(a: npt.ArrayLike, b: npt.ArrayLike) -> np.ndarray:
    """Products (..., 4) of quaternions: first b, then a.

    SciPy normalises products. These only permute and negate numbers where a factor is axis-aligned, so that mirrored
    and copied parts are equal to the last bit.
    """
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
