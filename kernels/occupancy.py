"""Counting sample points inside many candidates at once: what selection by gain asks over and over."""

from __future__ import annotations

import numpy as np
import warp as wp

from .launch import VECTOR_OPTIONS, launch

wp.set_module_options(VECTOR_OPTIONS)

GROUP = 64
"""Candidates a thread counts for."""
GROUP_C = wp.constant(GROUP)


@wp.kernel
def add_point_weights_kernel(
    first: int,
    bits: wp.array[wp.uint8],
    points: wp.array[int],
    weights: wp.array[float],
    task_first: wp.array[int],
    group_count: int,
    # outputs
    out_sums: wp.array[float],
):
    """Add one task's weighted points to its sums of one group of candidates, in the order of the list."""
    t = first + wp.tid()
    task = t / group_count
    base = (t - task * group_count) * GROUP_C
    store = task * group_count * GROUP_C + base
    for i in range(task_first[task], task_first[task + 1]):
        weight = weights[i]
        at = points[i] * group_count * GROUP_C + base
        for j in range(GROUP_C):
            out_sums[store + j] += weight * float(bits[at + j])


class CandidateBits:
    """Which sample points each candidate holds, point-major, so that the points of one candidate are whole rows."""

    def __init__(self, bits: np.ndarray, device: wp.Device):
        """`bits` (candidates, n) bool."""
        self.count, self.point_count = bits.shape
        self.group_count = max(1, -(-self.count // GROUP))
        packed = np.zeros((self.point_count, self.group_count * GROUP), np.uint8)
        packed[:, : self.count] = bits.T
        self.packed = wp.array(packed.ravel(), dtype=wp.uint8, device=device)

    def weigh(self, tasks: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
        """Sums of point weights inside each candidate, for several lists of points.

        Args:
            tasks: for each sum, points (m,) and their weights (m,).

        Returns:
            (candidates, tasks) float32; the same bytes however many cores count.
        """
        device = self.packed.device
        edges = np.cumsum([0] + [len(points) for points, _ in tasks]).astype(np.int32)
        points = np.concatenate([points for points, _ in tasks]).astype(np.int32)
        weights = np.concatenate([weights for _, weights in tasks]).astype(np.float32)
        sums = wp.zeros(len(tasks) * self.group_count * GROUP, dtype=float, device=device)
        if len(points):
            launch(
                add_point_weights_kernel,
                len(tasks) * self.group_count,
                [
                    self.packed,
                    wp.array(points, dtype=int, device=device),
                    wp.array(weights, dtype=float, device=device),
                    wp.array(edges, dtype=int, device=device),
                    self.group_count,
                ],
                [sums],
                device,
                seconds_per_thread=1e-8 * len(points) / len(tasks),
            )
        return sums.numpy().reshape(len(tasks), -1)[:, : self.count].T
