"""Turning, placing and scaling single parts, in the normalised frame."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from ...assembly.primitive import Pose, Primitive, Quaternion, Vector
from ...kernels.primitives import FAMILIES
from ...kernels.rotation import quaternion_of

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

SMALLEST = 1e-4
"""Normalised units: nothing is pushed thinner, because it could not be pulled open again."""


def to_vector(values: npt.ArrayLike) -> Vector:
    """Three numbers as a tuple of floats."""
    x, y, z = (float(value) for value in np.asarray(values, np.float64))
    return x, y, z


def to_angles(rotation: Quaternion) -> Vector:
    """Turns about x, then y, then z of the normalised frame, in degrees, of a unit quaternion (w, x, y, z)."""
    with warnings.catch_warnings():
        # At 90 degrees about y one angle of the three is free, and becomes 0.
        warnings.filterwarnings("ignore", "Gimbal lock")
        return to_vector(_turn(rotation).as_euler("xyz", degrees=True) + 0.0)


def to_quaternion(angles: Vector) -> Quaternion:
    """The unit quaternion (w, x, y, z) of turns about x, then y, then z, in degrees."""
    return _quaternion(_turns(angles))


def turned(rotation: Quaternion, angles: Vector) -> Quaternion:
    """A rotation followed by turns about x, then y, then z of the normalised frame, in degrees."""
    return _quaternion(_turns(angles) * _turn(rotation))


def pose_matrix(pose: Pose) -> np.ndarray:
    """(4, 4) float64: local to normalised frame."""
    matrix = np.eye(4)
    matrix[:3, :3] = pose.matrix()
    matrix[:3, 3] = pose.translation
    return matrix


def placed(part: Primitive, matrix: npt.ArrayLike) -> Primitive:
    """A part moved, turned and stretched.

    Args:
        part: as it was.
        matrix: (4, 4), takes its local frame to the normalised one: a rotation with scaled columns.

    Raises:
        InputError: if the matrix flattens or mirrors the part.
    """
    matrix = np.asarray(matrix, np.float64)
    factors = np.linalg.norm(matrix[:3, :3], axis=0)
    if not (np.isfinite(matrix).all() and factors.min() > 1e-9 and np.linalg.det(matrix[:3, :3]) > 0.0):
        raise InputError("a part cannot be turned inside out or made flat.")
    rotation = part.pose.rotation
    difference = part.pose.matrix() - matrix[:3, :3] / factors
    # Where nothing was turned or stretched, the numbers stay as they were, to the bit.
    if np.abs(difference).max() > 1e-6:
        w, x, y, z = (float(value) for value in quaternion_of(matrix[:3, :3] / factors))
        rotation = (w, x, y, z)
    stretched = np.abs(factors - 1.0).max() > 1e-6
    parameters = scaled_parameters(part, factors) if stretched else part.parameters
    return replace(part, pose=Pose(to_vector(matrix[:3, 3]), rotation), parameters=parameters)


def scaled_parameters(part: Primitive, factors: float | npt.ArrayLike) -> dict[str, float | Vector]:
    """Parameters of a part after scaling: by one factor all lengths change, by three (one an axis) only the extents.

    A family without `size` has no extents of its own: it is scaled by the mean of three factors.
    """
    entry, values = FAMILIES[part.family], dict(part.parameters)
    scale = np.asarray(factors, np.float64)
    if entry.has("size"):
        values["size"] = to_vector(np.maximum(np.multiply(values["size"], scale), SMALLEST))
    elif scale.ndim:
        scale = np.asarray(np.cbrt(scale.prod()))
    if scale.ndim == 0:
        for parameter in entry.parameters:
            if parameter.unit == "length" and parameter.count == 1:
                values[parameter.name] = float(np.multiply(values[parameter.name], scale))
    return values


def _turn(quaternion: Quaternion) -> Rotation:
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(quaternion, scalar_first=True)


def _turns(angles: Vector) -> Rotation:
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("xyz", angles, degrees=True)


def _quaternion(turn: Rotation) -> Quaternion:
    w, x, y, z = (float(value) for value in turn.as_quat(scalar_first=True))
    return w, x, y, z
