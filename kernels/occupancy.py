"""Counting sample points inside many candidates at once: what selection by gain asks over and over.

Points come in four kinds, 0 to 3, whose weights are summed apart; kinds 2 and 3 are points of the box, of which those
held twice are counted too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from .launch import VECTOR_OPTIONS, launch
from .replay import Replay

wp.set_module_options(VECTOR_OPTIONS)

WORD = 32
"""Candidates a word has a bit each for."""
GROUP = 64
"""Candidates a thread counts for."""
WORD_C, GROUP_C, WORDS_C = wp.constant(WORD), wp.constant(GROUP), wp.constant(GROUP // WORD)

SUMS = 5
"""Numbers of a removal: weights by kind, then points held twice."""
SUMS_C = wp.constant(SUMS)


@wp.kernel
def add_point_weights_kernel(
    first: int,
    bits: wp.array[wp.uint32],
    points: wp.array[int],
    weights: wp.array[float],
    task_first: wp.array[int],
    size: wp.array[int],
    # outputs
    out_sums: wp.array[float],
):
    """Add one task's weighted points to its sums of one group of candidates, in the order of the list.

    `size` is the number of groups in use, and the words of a row of `bits`.
    """
    t = first + wp.tid()
    group_count = size[0]
    task = t / group_count
    group = t - task * group_count
    store = t * GROUP_C
    for j in range(GROUP_C):
        out_sums[store + j] = 0.0
    for i in range(task_first[task], task_first[task + 1]):
        weight = weights[i]
        at = points[i] * size[1] + group * WORDS_C
        for word in range(WORDS_C):
            held = bits[at + word]
            for j in range(WORD_C):
                held_by_j = float(int((held >> wp.uint32(j)) & wp.uint32(1)))
                out_sums[store + word * WORD_C + j] += weight * held_by_j


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
    for entry in range(SUMS_C):
        out_sums[member * SUMS_C + entry] = wp.float64(0.0)
    for i in range(edges[k], edges[k + 1]):
        point = points[i]
        held = counts[point]
        at = member * SUMS_C + int(kind[point])
        if held == 1:
            out_sums[at] = out_sums[at] + weight[point]
        elif held == 2 and kind[point] >= wp.uint8(2):
            at = member * SUMS_C + SUMS_C - 1
            out_sums[at] = out_sums[at] + wp.float64(1.0)


class Buffer:
    """An array that the host fills and the device reads, or the other way round; one memory on the CPU."""

    def __init__(self, size: int, dtype: type, device: wp.Device):
        self.host = np.zeros(max(1, size), dtype)
        scalar = wp.dtype_from_numpy(self.host.dtype)
        self.array = wp.array(self.host, dtype=scalar, device=device, copy=not device.is_cpu)

    def upload(self) -> None:
        """Bring what the host wrote to the device."""
        if not self.array.device.is_cpu:
            self.array.assign(self.host)

    def download(self) -> np.ndarray:
        """What the device wrote."""
        return self.host if self.array.device.is_cpu else self.array.numpy()


class Holdings:
    """Which sample points each candidate holds."""

    def __init__(self, bits: np.ndarray, device: wp.Device):
        """`bits` (candidates, n) bool."""
        self.device, self.point_count = device, bits.shape[1]
        self.lists: list[np.ndarray] = []
        self.sizes = np.zeros(0, np.int64)
        self.packed: Buffer | None = None
        self.scratch: _WeighScratch | None = None
        self.append(bits)

    @property
    def count(self) -> int:
        """Candidates."""
        return len(self.lists)

    def append(self, bits: np.ndarray) -> None:
        """Further candidates, `bits` (k, n) bool."""
        sizes = np.count_nonzero(bits, axis=1)
        places = np.flatnonzero(bits) % max(1, self.point_count)
        if len(bits):
            self.lists += np.split(places, np.cumsum(sizes)[:-1])
        self.sizes = np.append(self.sizes, sizes)
        if self.packed is not None:
            self._pack(self.count - len(bits), bits)

    def truncate(self, count: int) -> None:
        """Forget all candidates but the first `count`."""
        if self.packed is not None:
            words, rest = self._words(), count % WORD
            words[:, -(-count // WORD) :] = 0
            if rest:
                words[:, count // WORD] &= np.uint32((1 << rest) - 1)
            self.packed.upload()
        del self.lists[count:]
        self.sizes = self.sizes[:count]

    def drop_first(self, count: int) -> None:
        """Forget the first `count` candidates."""
        del self.lists[:count]
        self.sizes, self.packed = self.sizes[count:], None

    def weigh(self, tasks: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
        """Sums of point weights inside each candidate, for several lists of points.

        Args:
            tasks: for each sum, points (m,) and their weights (m,).

        Returns:
            (candidates, tasks) float32; the same bytes however many cores count.
        """
        if self.packed is None:
            self._pack(0, self._bits())
        packed = self.packed
        assert packed is not None
        groups = max(1, -(-self.count // GROUP))
        needed = sum(len(points) for points, _ in tasks), len(tasks), groups
        if self.scratch is None or not self.scratch.fits(packed, needed):
            self.scratch = _WeighScratch(packed, needed, self.device)
        return self.scratch.weigh(tasks, groups, self._words().shape[1])[: self.count]

    def _bits(self) -> np.ndarray:
        bits = np.zeros((self.count, self.point_count), bool)
        for row, places in zip(bits, self.lists, strict=True):
            row[places] = True
        return bits

    def _words(self) -> np.ndarray:
        """The packed bits, a row of words a point."""
        assert self.packed is not None
        return self.packed.host.reshape(self.point_count, -1)

    def _pack(self, begin: int, bits: np.ndarray) -> None:
        """Write candidates from `begin` on, a row of bits a point: what holds a point is read at once."""
        end = begin + len(bits)
        if self.packed is None or end > WORD * self._words().shape[1]:
            groups = max(1, -(-(end + end // 2) // GROUP))
            wider = Buffer(self.point_count * groups * (GROUP // WORD), np.uint32, self.device)
            if self.packed is not None:
                before = self._words()
                wider.host.reshape(self.point_count, -1)[:, : before.shape[1]] = before
            self.packed = wider
        words = self._words()
        for index, held in enumerate(bits, begin):
            words[:, index // WORD] |= held.astype(np.uint32) << np.uint32(index % WORD)
        self.packed.upload()


class _WeighScratch:
    """Arrays of fixed size for `Holdings.weigh`, and the launch on them."""

    def __init__(self, packed: Buffer, needed: tuple[int, int, int], device: wp.Device):
        points, tasks, groups = (2 * number for number in needed)
        self.packed, self.limits = packed, (max(points, 4096), max(tasks, 8), groups)
        self.points = Buffer(self.limits[0], np.int32, device)
        self.weights = Buffer(self.limits[0], np.float32, device)
        self.edges = Buffer(self.limits[1] + 1, np.int32, device)
        self.size = Buffer(2, np.int32, device)
        self.sums = Buffer(self.limits[1] * groups * GROUP, np.float32, device)
        self.threads, self.device = 0, device
        self.run = Replay(self._launch, device, capture=False)

    def fits(self, packed: Buffer, needed: tuple[int, int, int]) -> bool:
        """Whether tasks of this many points, tasks and groups of candidates fit in."""
        return packed is self.packed and all(
            number <= limit for number, limit in zip(needed, self.limits, strict=True)
        )

    def _launch(self) -> None:
        launch(
            add_point_weights_kernel,
            lambda: self.threads,
            [self.packed.array, self.points.array, self.weights.array, self.edges.array, self.size.array],
            [self.sums.array],
            self.device,
            seconds_per_thread=1e-6,
        )

    def weigh(self, tasks: list[tuple[np.ndarray, np.ndarray]], groups: int, stride: int) -> np.ndarray:
        """Sums (groups * GROUP, tasks)."""
        end = 0
        for number, (points, weights) in enumerate(tasks):
            self.points.host[end : end + len(points)] = points
            self.weights.host[end : end + len(points)] = weights
            end += len(points)
            self.edges.host[number + 1] = end
        self.size.host[:] = groups, stride
        for buffer in (self.points, self.weights, self.edges, self.size):
            buffer.upload()
        self.threads = len(tasks) * groups
        self.run()
        sums = self.sums.download()[: self.threads * GROUP]
        return sums.reshape(len(tasks), -1).T.copy()


class RemovalSums:
    """What would no longer be held without each member of a choice."""

    def __init__(self, holdings: Holdings, counts: np.ndarray, kind: np.ndarray, weight: np.ndarray):
        """`counts` (n,) int32, how many members hold each point, is kept up to date by the caller, in place; `kind`
        (n,) 0 to 3 and `weight` (n,) are the points'."""
        self.device, self.counts = holdings.device, counts
        self.edges = np.append(0, np.cumsum(holdings.sizes)).astype(np.int32)
        points = np.concatenate(holdings.lists) if holdings.lists else np.zeros(0)
        fixed = [self.edges, points.astype(np.int32)]
        self.fixed = [wp.array(values, dtype=int, device=self.device) for values in fixed]
        # On the CPU the same memory: it changes with the caller's.
        self.seen = wp.array(counts, dtype=int, device=self.device, copy=not self.device.is_cpu)
        self.kind = wp.array(kind.astype(np.uint8), dtype=wp.uint8, device=self.device)
        self.weight = wp.array(weight.astype(np.float64), dtype=wp.float64, device=self.device)
        self.members = Buffer(holdings.count, np.int32, self.device)
        self.sums = Buffer(holdings.count * SUMS, np.float64, self.device)
        self.member_count = 0
        self.run = Replay(self._launch, self.device, capture=False)

    def _launch(self) -> None:
        launch(
            sum_removals_kernel,
            lambda: self.member_count,
            [self.members.array, *self.fixed, self.seen, self.kind, self.weight],
            [self.sums.array],
            self.device,
            seconds_per_thread=1e-6,
        )

    def of(self, members: Sequence[int]) -> np.ndarray:
        """Weights uncovered by kind, and box points no longer held twice, without each: (members, SUMS) float64."""
        self.member_count = len(members)
        self.members.host[: len(members)] = members
        self.members.upload()
        if not self.device.is_cpu:
            self.seen.assign(self.counts)
        self.run()
        return self.sums.download()[: len(members) * SUMS].reshape(-1, SUMS).copy()
