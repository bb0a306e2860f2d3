"""A learned sweep axis: each primitive is a mixture of three, one along each axis (superfrustum.md, "Sweep axis").

Their distances are mixed by a Gumbel softmax over three logits a primitive; position, size and all else they share.
After the early steps the likeliest axis is baked into rotation and size, and the primitive is a plain one again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp
from scipy.special import softmax

from ...kernels.field.adjoint import by_block, by_primitive, differentiable_assembly
from ...kernels.field.points import PointBlocks
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.rotation import multiply
from ...kernels.rows import BLEND, GATE, ROTATION, ROW, SHAPE, SHAPES, TRANSLATION
from ..objective.objective import ObjectiveSamples
from ..presets import AdamConfig
from .adam_loss import fold_prefixes, loss_gradients, unfold

TURNS = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
"""Which of the primitive's axes the x, y and z of each copy are; z is the sweep axis. The first is as it was."""

TURN_QUATERNIONS = np.array([[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.5, 0.5], [-0.5, 0.5, 0.5, 0.5]])
"""Rotations (w, x, y, z) from a copy's frame to the primitive's: they take its axis j to axis TURNS[i][j]."""


RIGHT = np.stack([multiply(np.eye(4), turn).T for turn in TURN_QUATERNIONS])
"""Matrices (3, 4, 4) that multiply a quaternion by each of TURN_QUATERNIONS from the right."""

SIZE = slice(SHAPES, SHAPES + 3)
"""Where a family has a size, its shape begins with it."""


def turned_copies(rows: np.ndarray) -> np.ndarray:
    """Rows (primitive_count, 3, ROW) of each primitive in the three turns; the same box, another sweep axis."""
    copies = np.repeat(rows[:, None], 3, axis=1)
    for turn, order in enumerate(TURNS):
        copies[:, turn, ROTATION : ROTATION + 4] = rows[:, ROTATION : ROTATION + 4] @ RIGHT[turn].T
        copies[:, turn, SIZE] = rows[:, SHAPES + np.array(order)]
    return copies


def _gathered_gradient(copies_grad: np.ndarray) -> np.ndarray:
    """Gradient (primitive_count, ROW) to the primitives from that to their copies (primitive_count, 3, ROW)."""
    total = np.zeros((len(copies_grad), ROW))
    total[:, TRANSLATION : TRANSLATION + 3] = copies_grad[:, :, TRANSLATION : TRANSLATION + 3].sum(1)
    total[:, SHAPES + 3 : SHAPES + SHAPE] = copies_grad[:, :, SHAPES + 3 : SHAPES + SHAPE].sum(1)
    for turn, order in enumerate(TURNS):
        total[:, ROTATION : ROTATION + 4] += copies_grad[:, turn, ROTATION : ROTATION + 4] @ RIGHT[turn]
        total[:, SHAPES + np.array(order)] += copies_grad[:, turn, SIZE]
    return total


class SweepAxes:
    """Axis logits of some primitives, and the gradient of the loss on their mixtures."""

    def __init__(self, families: Sequence[str], device: wp.Device) -> None:
        """Begin undecided."""
        self.logits = np.zeros((len(families), 3))
        names = [name for name in families for _ in range(3)]
        self._copies = PrimitiveSet(
            np.zeros((len(names), ROW), np.float32), names, device, requires_grad=True
        )

    def gradients(
        self,
        rows: np.ndarray,
        noise: np.ndarray,
        temperature: float,
        blocks: PointBlocks,
        samples: ObjectiveSamples,
        batch: np.ndarray,
        beta: float,
        config: AdamConfig,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Gradients of the loss to the rows (primitive_count, ROW) and to the logits (primitive_count, 3).

        Args:
            rows: the primitives, gates included.
            noise: (primitive_count, 3) Gumbel noise of the logits.
            temperature: of their softmax.
            blocks: the points of the batch.
            samples: what the loss compares with.
            batch: which of the samples these are.
            beta: sharpness of the occupancy.
            config: weights of the loss.
        """
        copies = turned_copies(rows)
        copies[:, :, BLEND], copies[:, :, GATE] = 0.0, 1.0
        self._copies.set_rows(copies.reshape(-1, ROW))
        tape = wp.Tape()
        _, values = differentiable_assembly(self._copies, blocks, tape)
        swept = by_primitive(values, len(self._copies), blocks.count).reshape(len(rows), 3, -1)
        weights = softmax((self.logits + noise) / temperature, axis=1)
        mixed = np.einsum("ki,kin->kn", weights, swept)
        gates, blends = rows[:, GATE], rows[:, BLEND]
        gated = gates[:, None] * mixed + 1.0 - gates[:, None]
        prefixes = fold_prefixes(gated, blends)
        field_grad, gated_grad = loss_gradients(
            prefixes[-1], mixed, gates, samples.distance[batch], samples.weight[batch], beta, config
        )
        passed, blend_grad = unfold(prefixes, gated, blends, field_grad)
        gated_grad = gated_grad + passed
        mixed_grad = gates[:, None] * gated_grad
        swept_grad = weights[:, :, None] * mixed_grad[:, None]
        logits_grad = (swept_grad * (swept - mixed[:, None])).sum(2) / temperature
        asked = by_block(swept_grad.reshape(len(self._copies), -1))
        tape.backward(grads={values: wp.array(asked, dtype=float, device=self._copies.device)})
        assert self._copies.rows.grad is not None
        total = _gathered_gradient(self._copies.rows.grad.numpy().reshape(len(rows), 3, ROW))
        tape.zero()
        total[:, BLEND] = blend_grad
        total[:, GATE] = (gated_grad * (mixed - 1.0)).sum(1)
        return total, logits_grad

    def baked(self, rows: np.ndarray) -> np.ndarray:
        """Rows (primitive_count, ROW) with the likeliest sweep axis of each as its own."""
        return turned_copies(rows)[np.arange(len(rows)), self.logits.argmax(1)]
