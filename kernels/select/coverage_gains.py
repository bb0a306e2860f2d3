"""A choice among candidates: how often its members hold each sample point, and what moves would make of that.

Of what a set holds there are the sums of a hard union (see `objective_sums`): the weights of the points it covers, by
kind, and the points of the box that it covers twice. Weights are float32, so that float64 sums of them are exact, in
whatever order they are taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..runtime.buffers import Buffer
from ..runtime.launch import VECTOR_OPTIONS, launch
from ..runtime.launch_graph import LaunchGraph
from .coverage_sets import GROUP, GROUP_C, WORD_C, WORDS_C, CandidateCoverage
from .objective_sums import BOX_KIND_C, HARD_SUMS, HARD_SUMS_C, TWICE_C

wp.set_module_options(VECTOR_OPTIONS)


@wp.kernel
def recount_kernel(
    first: int,
    change: wp.array[int],
    edges: wp.array[int],
    points: wp.array[int],
    kind: wp.array[wp.uint8],
    weight: wp.array[wp.float64],
    # outputs
    out_counts: wp.array[int],
    out_held: wp.array[wp.float64],
    out_moved_count: wp.array[int],
    out_moved: wp.array[int],
    out_freed: wp.array[float],
    out_once: wp.array[float],
):
    """Count one candidate's points once more or once less, by one thread; `change` is the candidate and the step.

    Points that so become free or cover, or get or lose a single holder, are listed as moved: by what weight more
    there is free to cover, and how many more points of the box there are to cover twice.
    """
    candidate = change[first + wp.tid()]
    step = change[1]
    moved = int(0)
    for i in range(edges[candidate], edges[candidate + 1]):
        point = points[i]
        before = out_counts[point]
        out_counts[point] = before + step
        fewer = wp.min(before, before + step)
        number = int(kind[point])
        in_box = number >= BOX_KIND_C
        if fewer == 0:
            change_of_weight = wp.float64(step) * weight[point]
            out_held[number] = out_held[number] + change_of_weight
            out_moved[moved] = point
            out_freed[moved] = -float(change_of_weight)
            out_once[moved] = wp.where(in_box, float(step), 0.0)
            moved += 1
        elif fewer == 1 and in_box:
            out_held[TWICE_C] = out_held[TWICE_C] + wp.float64(step)
            out_moved[moved] = point
            out_freed[moved] = 0.0
            out_once[moved] = -float(step)
            moved += 1
    out_moved_count[0] = moved


@wp.kernel
def update_sums_kernel(
    first: int,
    bits: wp.array[wp.uint32],
    stride: int,
    group_count: int,
    kind: wp.array[wp.uint8],
    moved_count: wp.array[int],
    moved: wp.array[int],
    freed: wp.array[float],
    once: wp.array[float],
    # outputs
    out_change: wp.array[float],
    out_sums: wp.array[wp.float64],
):
    """Add to the sums of a group of candidates what moved points change in them, in the order of their list."""
    group = first + wp.tid()
    store = group * HARD_SUMS_C * GROUP_C
    twice = store + TWICE_C * GROUP_C
    for j in range(HARD_SUMS_C * GROUP_C):
        out_change[store + j] = 0.0
    for i in range(moved_count[0]):
        point = moved[i]
        at = point * stride + group * WORDS_C
        for word in range(WORDS_C):
            held = bits[at + word]
            if held != wp.uint32(0):
                weight = freed[i]
                if weight != 0.0:
                    by_kind = store + int(kind[point]) * GROUP_C + word * WORD_C
                    for j in range(WORD_C):
                        here = (held & (wp.uint32(1) << wp.uint32(j))) != wp.uint32(0)
                        out_change[by_kind + j] += wp.where(here, weight, 0.0)
                number = once[i]
                if number != 0.0:
                    for j in range(WORD_C):
                        here = (held & (wp.uint32(1) << wp.uint32(j))) != wp.uint32(0)
                        out_change[twice + word * WORD_C + j] += wp.where(here, number, 0.0)
    for entry in range(HARD_SUMS_C):
        row = (entry * group_count + group) * GROUP_C
        for j in range(GROUP_C):
            out_sums[row + j] += wp.float64(out_change[store + entry * GROUP_C + j])


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
    """Sum what one member alone holds, by kind, and the points of the box that it and just one other hold."""
    member = first + wp.tid()
    k = members[member]
    for entry in range(HARD_SUMS_C):
        out_sums[member * HARD_SUMS_C + entry] = wp.float64(0.0)
    for i in range(edges[k], edges[k + 1]):
        point = points[i]
        held = counts[point]
        at = member * HARD_SUMS_C + int(kind[point])
        if held == 1:
            out_sums[at] = out_sums[at] + weight[point]
        elif held == 2 and int(kind[point]) >= BOX_KIND_C:
            at = member * HARD_SUMS_C + TWICE_C
            out_sums[at] = out_sums[at] + wp.float64(1.0)


@dataclass(frozen=True)
class ChangedPoints:
    """Points at which a change of the counts changes what a candidate would add; see `recount_kernel`."""

    count: wp.array
    points: wp.array
    freed: wp.array
    once: wp.array


class CoverageCounts:
    """Coverage counts: number of members of a choice that hold each point, and the sums of what they hold.

    Attributes:
        counts: (point_count,) int32.
        held: (HARD_SUMS,) float64.
        moved: by the last change.
    """

    def __init__(self, coverage: CandidateCoverage, kind: np.ndarray, weight: np.ndarray):
        """No members yet. `kind` (point_count,) is 0 to 3, `weight` (point_count,) at least 0."""
        self.coverage, self.device = coverage, coverage.device
        self.kind = wp.array(kind.astype(np.uint8), dtype=wp.uint8, device=self.device)
        self.weight = wp.array(weight.astype(np.float64), dtype=wp.float64, device=self.device)
        self.counts = Buffer(coverage.point_count, np.int32, self.device)
        self.held = Buffer(HARD_SUMS, np.float64, self.device)
        self.change = Buffer(2, np.int32, self.device)
        points, weights = (
            [wp.empty(max(1, coverage.point_count), dtype=dtype, device=self.device) for _ in range(2)]
            for dtype in (int, float)
        )
        self.moved = ChangedPoints(wp.zeros(1, dtype=int, device=self.device), points[0], *weights)
        self.run = LaunchGraph(self._launch, self.device, capture=False)

    def _launch(self) -> None:
        moved = self.moved
        launch(
            recount_kernel,
            1,
            [self.change.array, self.coverage.edges, self.coverage.points, self.kind, self.weight],
            [
                self.counts.array,
                self.held.array,
                moved.count,
                moved.points,
                moved.freed,
                moved.once,
            ],
            self.device,
        )

    def count(self, candidate: int, step: int) -> None:
        """Count the points of a candidate once more (step 1) or once less (-1)."""
        self.change.host[:] = candidate, step
        self.change.upload()
        self.run()
        self.held.download()

    def save(self) -> tuple[np.ndarray, np.ndarray]:
        """Snapshot from which `restore` comes back to these counts."""
        return self.counts.download().copy(), self.held.host.copy()

    def restore(self, saved: tuple[np.ndarray, np.ndarray]) -> None:
        """Come back to saved counts."""
        self.counts.host[:], self.held.host[:] = saved
        self.counts.upload()
        self.held.upload()

    def removals(self, members: Sequence[int]) -> np.ndarray:
        """Marginal loss without each of the members: (members, HARD_SUMS) float64."""
        asked = wp.array(np.array(members, np.int32), dtype=int, device=self.device)
        sums = wp.empty(max(1, len(members) * HARD_SUMS), dtype=wp.float64, device=self.device)
        launch(
            sum_removals_kernel,
            len(members),
            [
                asked,
                self.coverage.edges,
                self.coverage.points,
                self.counts.array,
                self.kind,
                self.weight,
            ],
            [sums],
            self.device,
            seconds_per_thread=1e-6,
        )
        return sums.numpy()[: len(members) * HARD_SUMS].reshape(-1, HARD_SUMS)


class MarginalGains:
    """Marginal gain of each candidate over a choice, mended where a change of the counts changes it."""

    def __init__(self, counts: CoverageCounts):
        """`counts` has no members yet."""
        self.counts, coverage = counts, counts.coverage
        self.bits, self.group_count = coverage.bits(), coverage.group_count
        self.sums = Buffer(HARD_SUMS * self.group_count * GROUP, np.float64, counts.device)
        # With nothing chosen, a candidate adds just what would be missing if it alone were there.
        counts.counts.host.fill(1)
        counts.counts.upload()
        self.of_all()[:] = counts.removals(range(coverage.count))
        self.sums.upload()
        counts.counts.host.fill(0)
        counts.counts.upload()
        self.change = wp.empty(self.sums.array.shape[0], dtype=float, device=counts.device)
        self.run = LaunchGraph(self._launch, counts.device, capture=False)

    def of_all(self) -> np.ndarray:
        """Marginal gain of the sums with each candidate: (candidates, HARD_SUMS) float64."""
        width = self.group_count * GROUP
        return (
            self.sums.host[: HARD_SUMS * width].reshape(HARD_SUMS, width)[:, : self.counts.coverage.count].T
        )

    def _launch(self) -> None:
        counts, moved = self.counts, self.counts.moved
        launch(
            update_sums_kernel,
            self.group_count,
            [
                self.bits,
                counts.coverage.stride,
                self.group_count,
                counts.kind,
                moved.count,
                moved.points,
                moved.freed,
                moved.once,
            ],
            [self.change, self.sums.array],
            counts.device,
            seconds_per_thread=5e-6,
        )

    def update(self) -> None:
        """Follow the last change of the counts."""
        self.run()
        self.sums.download()

    def save(self) -> np.ndarray:
        """Snapshot from which `restore` comes back to these sums."""
        return self.sums.host.copy()

    def restore(self, saved: np.ndarray) -> None:
        """Come back to saved sums."""
        self.sums.host[:] = saved
        self.sums.upload()
