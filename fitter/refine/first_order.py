"""Common base of first-order optimisers: primitives as unbounded numbers, and Adam's running averages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation

from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.field.raw_parameters import RAW_BLEND, RAW_DROP, RAW_KEEP, RAW_SHAPE, RAW_TURN, activate_rows
from ...kernels.primitives import family
from ...kernels.rows import BLEND, ROTATION, ROW, SHAPE, SHAPES

DECAY = (0.9, 0.99)
EPSILON = 1e-8

SMALLEST_BLEND = 1e-3
"""Blends start at least this wide: the slope of a narrower one's softplus is dead."""


def to_raw(rows: np.ndarray, families: Sequence[str]) -> np.ndarray:
    """Raw numbers (primitive_count, ROW) whose activation is `rows`; gates become confident logits."""
    raw = np.zeros((len(rows), ROW))
    raw[:, :3] = rows[:, :3]
    raw[:, RAW_TURN : RAW_TURN + 3] = Rotation.from_quat(
        rows[:, ROTATION : ROTATION + 4], scalar_first=True
    ).as_rotvec()
    for k, name in enumerate(families):
        raw[k, RAW_SHAPE : RAW_SHAPE + SHAPE] = family(name).to_raw(rows[k, SHAPES : SHAPES + SHAPE])
    raw[:, RAW_BLEND] = np.log(np.expm1(np.maximum(rows[:, BLEND], SMALLEST_BLEND)))
    raw[:, RAW_KEEP] = 1.0
    raw[:, RAW_DROP] = -1.0
    return raw.astype(np.float32)


class Unbounded:
    """Primitives behind unbounded numbers: `raw` (primitive_count, ROW) float32 is what an optimiser moves."""

    def __init__(self, rows: np.ndarray, families: Sequence[str], device: wp.Device) -> None:
        """Take (primitive_count, ROW) rows, at least one, and their families."""
        self.families = tuple(families)
        self.primitives = PrimitiveSet(rows, families, device, requires_grad=True)
        bounds = [family(name).fit_range for name in families]
        self._low, self._high = (
            wp.array(np.stack([pair[side] for pair in bounds]).ravel(), dtype=float, device=device)
            for side in range(2)
        )
        self.raw = to_raw(rows, families)
        self._variable = wp.array(self.raw.ravel(), dtype=float, device=device, requires_grad=True)

    def __len__(self) -> int:
        return len(self.families)

    def activate(self, tape: wp.Tape, noise: np.ndarray | None = None, temperature: float = 1.0) -> None:
        """Set the primitives from `raw` as a step of `tape`.

        Args:
            tape: records it.
            noise: (primitive_count, 2) Gumbel noise of the existence logits; none unless given.
            temperature: of the existence softmax.
        """
        self._variable.assign(self.raw.ravel())
        noise = np.zeros((len(self), 2)) if noise is None else noise
        activate_rows(self._variable, self._low, self._high, noise, temperature, self.primitives, tape)

    def rows(self) -> np.ndarray:
        """Parameter rows that `raw` stands for, without noise: (primitive_count, ROW) float32."""
        self.activate(wp.Tape())
        return self.primitives.rows_numpy()

    def gradient(self, tape: wp.Tape) -> np.ndarray:
        """Gradient (primitive_count, ROW) to `raw` after `tape.backward`; the tape's gradients are zero afterwards."""
        assert self._variable.grad is not None
        gradient = self._variable.grad.numpy().reshape(-1, ROW).copy()
        tape.zero()
        return gradient


class Moments:
    """Adam's running averages of a gradient and of its square."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        """Begin at zero, for arrays of `shape`."""
        self.mean, self.square, self.count = np.zeros(shape), np.zeros(shape), 0

    def step(self, gradient: np.ndarray, rate: float) -> np.ndarray:
        """Adam update to add to the variables, given their gradient and the learning rate."""
        self.count += 1
        self.mean = DECAY[0] * self.mean + (1.0 - DECAY[0]) * gradient
        self.square = DECAY[1] * self.square + (1.0 - DECAY[1]) * gradient**2
        scale = np.sqrt(self.square / (1.0 - DECAY[1] ** self.count)) + EPSILON
        return -rate * self.mean / (1.0 - DECAY[0] ** self.count) / scale
