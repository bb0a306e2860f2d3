"""The losses of the paper's optimiser and their derivatives to the distances."""

from __future__ import annotations

import numpy as np

from ...kernels.field.combine import combined, combined_share
from ..presets import AdamConfig
from .joint import MASK


def loss_gradients(
    field: np.ndarray,
    values: np.ndarray,
    gates: np.ndarray,
    distance: np.ndarray,
    weight: np.ndarray,
    beta: float,
    config: AdamConfig,
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the loss to the union (n,) and to each gated distance (primitive_count, n).

    Quality: max(0, sum o_i - 1) is space held twice; max(0, o - min(sum o_i, 1)) is space only the blends hold.

    Args:
        field: (n,) of the union.
        values: (primitive_count, n), each primitive's own distance, ungated.
        gates: (primitive_count,).
        distance: (n,) of the target.
        weight: (n,) of the points.
        beta: sharpness of the occupancy.
        config: weights of the terms.
    """

    def occupancy(f: np.ndarray) -> np.ndarray:
        return 1.0 / (1.0 + np.exp(np.clip(beta * f, -40.0, 40.0)))

    mask = (field < MASK) | (distance < MASK)
    count = max(1, int(mask.sum()))
    union = occupancy(field)
    slope = -beta * union * (1 - union)
    field_grad = mask * weight * 2.0 * (union - occupancy(distance)) * slope / count
    each = occupancy(gates[:, None] * values + (1.0 - gates[:, None]))
    total = each.sum(0)
    excess = (total > 1.0).astype(np.float32)
    blended = ((union > np.minimum(total, 1.0)) & (total < 1.0)).astype(np.float32)
    share = config.quality_weight * mask / count
    field_grad += share * (union > np.minimum(total, 1.0)) * slope
    values_grad = share * (excess - blended) * (-beta * each * (1 - each))
    return field_grad, values_grad


def fold_prefixes(gated: np.ndarray, blends: np.ndarray) -> np.ndarray:
    """Smooth unions (primitive_count, n) of the first k + 1 gated distances; the first blend is unused."""
    prefixes = [gated[0]]
    for value, blend in zip(gated[1:], blends[1:], strict=True):
        prefixes.append(combined(prefixes[-1], value, blend))
    return np.stack(prefixes)


def unfold(
    prefixes: np.ndarray, gated: np.ndarray, blends: np.ndarray, field_grad: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Undo the fold from its end: derivatives to each gated distance (primitive_count, n), and to the blends."""
    carry, passed, blend_grad = field_grad, np.zeros_like(gated), np.zeros(len(gated))
    for k in range(len(gated) - 1, 0, -1):
        keep = combined_share(prefixes[k - 1], gated[k], blends[k])
        passed[k] = carry * (1.0 - keep)
        blend_grad[k] = -(passed[k] * keep).sum()
        carry = carry * keep
    passed[0] = carry
    return passed, blend_grad
