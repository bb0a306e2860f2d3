"""Counting sample points inside many candidates at once: what selection by gain asks over and over.

Points come in four kinds, 0 to 3, whose weights are summed apart; kinds 2 and 3 are points of the box, of which those
held twice are counted too.
"""

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


@wp.kernel
def sum_removals_kernel(
    first: int,
    members: wp.array[int],
    edges: wp.array[int],
    points: wp.array[int],
    counts: wp.array[int],
    kind: wp.array[wp.uint8],
    weight: wp.array[wp.float64],
    # outputs
    out_sums: wp.array[wp.float64],
):
    """What one member alone holds, by kind, and the points of the box that it and just one other hold."""
    member = first + wp.tid()
    k = members[member]
    for i in range(edges[k], edges[k + 1]):
        point = points[i]
        held = counts[point]
        at = member * 5 + int(kind[point])
        if held == 1:
            out_sums[at] = out_sums[at] + weight[point]
        elif held == 2 and kind[point] >= wp.uint8(2):
            out_sums[member * 5 + 4] = out_sums[member * 5 + 4] + wp.float64(1.0)


class HeldPoints:
    """The points that each candidate holds, list after list."""

    def __init__(self, bits: np.ndarray, kind: np.ndarray, weight: np.ndarray, device: wp.Device):
        """`bits` (candidates, n) bool; `kind` (n,) 0 to 3 and `weight` (n,) of the points."""
        self.device = device
        self.sizes = np.count_nonzero(bits, axis=1)
        ends = np.cumsum(self.sizes)
        places = np.flatnonzero(bits) % max(1, bits.shape[1])
        self.lists = np.split(places, ends[:-1]) if len(bits) else []
        self.edges = wp.array(np.append(0, ends).astype(np.int32), dtype=int, device=device)
        self.points = wp.array(places.astype(np.int32), dtype=int, device=device)
        self.kind = wp.array(kind.astype(np.uint8), dtype=wp.uint8, device=device)
        self.weight = wp.array(weight.astype(np.float64), dtype=wp.float64, device=device)

    def removals(self, members: list[int], counts: np.ndarray) -> np.ndarray:
        """What would be uncovered, by kind, and no longer be held twice in the box, without each of the members.

        Args:
            members: candidates that are chosen.
            counts: (n,) int32, how many of them hold each point.

        Returns:
            (members, 5) float64.
        """
        sums = wp.zeros(len(members) * 5, dtype=wp.float64, device=self.device)
        launch(
            sum_removals_kernel,
            len(members),
            [
                wp.array(np.array(members, np.int32), dtype=int, device=self.device),
                self.edges,
                self.points,
                wp.array(counts, dtype=int, device=self.device, copy=False),
                self.kind,
                self.weight,
            ],
            [sums],
            self.device,
            seconds_per_thread=2e-9 * float(self.sizes[members].mean()) if members else 0.0,
        )
        return sums.numpy().reshape(-1, 5)
