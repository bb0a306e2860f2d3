"""IntraPrim and InterPrim: whether the parts of an assembly are parts to whoever made the features.

Features are vectors at points on the target's surface. A point belongs to the primitive whose surface is nearest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from resfit.errors import InputError


@dataclass(frozen=True)
class Semantics:
    """Variance of features within primitives and between them."""

    intra_prim: float
    """Mean squared distance of a point's feature to the mean feature of its primitive; 0 is best."""
    inter_prim: float
    """Mean over the points of the distance from their primitive's mean feature to the nearest other one; more is
    better, and 0 where there is one primitive."""


def measure_semantics(features: np.ndarray, owners: np.ndarray) -> Semantics:
    """IntraPrim and InterPrim of features at points, each owned by a primitive.

    Args:
        features: (n, d), n > 0; they are brought to unit length here.
        owners: (n,) int, the primitive of each point. Primitives without points take no part.

    Raises:
        InputError: if the features are not n finite vectors.
    """
    unit = _unit_features(features, len(owners))
    _, member, count = np.unique(owners, return_inverse=True, return_counts=True)
    centre = np.zeros((len(count), unit.shape[1]))
    np.add.at(centre, member, unit)
    centre /= count[:, None]
    intra = float(((unit - centre[member]) ** 2).sum(axis=1).mean())
    if len(count) < 2:
        return Semantics(intra, 0.0)
    from scipy.spatial import KDTree

    nearest = KDTree(centre).query(centre, k=2)[0][:, 1]
    return Semantics(intra, float((count * nearest).sum() / count.sum()))


def _unit_features(features: np.ndarray, count: int) -> np.ndarray:
    """Features (n, d) as float64 of unit length; a vector of zeros stays one.

    Raises:
        InputError: if they are not `count` finite vectors.
    """
    try:
        array = np.asarray(features, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError("the features are no array of numbers; give one vector a point.") from error
    if array.ndim != 2 or len(array) != count or not array.shape[1]:
        raise InputError(
            f"the features have shape {array.shape}, but there are {count} points; give one vector a point."
        )
    if not np.isfinite(array).all():
        raise InputError("some features are not finite numbers; check the program that made them.")
    length = np.linalg.norm(array, axis=1, keepdims=True)
    return array / np.where(length > 0.0, length, 1.0)
