"""Coverage sets of many candidates, in the two forms that selection asks for: lists of the sample points
that each candidate holds, and a row of bits for each point, one a candidate.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..runtime.launch import VECTOR_OPTIONS, launch

wp.set_module_options(VECTOR_OPTIONS)

WORD = 32
"""Candidates, or points, a word has a bit each for."""
GROUP = 64
"""Candidates a thread counts for."""
WORD_C, GROUP_C, WORDS_C = wp.constant(WORD), wp.constant(GROUP), wp.constant(GROUP // WORD)


@wp.kernel
def list_points_kernel(
    first: int,
    masks: wp.array[wp.uint32],
    word_count: int,
    edges: wp.array[int],
    begin: int,
    # outputs
    out_points: wp.array[int],
):
    """List the points in one candidate's mask, ascending, from edges[begin + candidate] on."""
    candidate = first + wp.tid()
    at = edges[begin + candidate]
    for word in range(word_count):
        left = masks[candidate * word_count + word]
        while left != wp.uint32(0):
            others = left & (left - wp.uint32(1))
            lowest = left ^ others
            out_points[at] = word * WORD_C + int(wp.bit_count(lowest - wp.uint32(1)))
            at += 1
            left = others


@wp.kernel
def toggle_bits_kernel(
    first: int,
    edges: wp.array[int],
    points: wp.array[int],
    begin: int,
    end: int,
    stride: int,
    # outputs
    out_bits: wp.array[wp.uint32],
):
    """Set the bits of those candidates from `begin` to `end` that share one word, or clear them if they are set."""
    word = begin / WORD_C + first + wp.tid()
    for candidate in range(wp.max(begin, word * WORD_C), wp.min(end, (word + 1) * WORD_C)):
        bit = wp.uint32(1) << wp.uint32(candidate - word * WORD_C)
        for i in range(edges[candidate], edges[candidate + 1]):
            at = points[i] * stride + word
            out_bits[at] = out_bits[at] ^ bit


@wp.kernel
def count_common_kernel(
    first: int,
    asked: wp.array[int],
    edges: wp.array[int],
    points: wp.array[int],
    bits: wp.array[wp.uint32],
    stride: int,
    group_count: int,
    # outputs
    out_common: wp.array[int],
):
    """Count the points that one candidate shares with each of a group of others."""
    t = first + wp.tid()
    task = t / group_count
    group = t - task * group_count
    candidate = asked[task]
    store = t * GROUP_C
    for j in range(GROUP_C):
        out_common[store + j] = 0
    for i in range(edges[candidate], edges[candidate + 1]):
        at = points[i] * stride + group * WORDS_C
        for word in range(WORDS_C):
            held = bits[at + word]
            for j in range(WORD_C):
                here = (held & (wp.uint32(1) << wp.uint32(j))) != wp.uint32(0)
                out_common[store + word * WORD_C + j] += wp.where(here, 1, 0)


def masks_of(bits: np.ndarray) -> np.ndarray:
    """Masks (k, words) uint32, a bit a point, of `bits` (k, n) bool."""
    packed = np.packbits(bits, axis=1, bitorder="little")
    words = -(-bits.shape[1] // WORD)
    padded = np.zeros((len(bits), 4 * words), np.uint8)
    padded[:, : packed.shape[1]] = packed
    return padded.view("<u4")


class CandidateCoverage:
    """Coverage sets: the sample points that each candidate holds.

    Attributes:
        count: candidates.
        point_count: sample points.
        sizes: (count,) points that each holds.
        edges, points: candidate k holds points[edges[k]] to points[edges[k + 1] - 1], ascending. Both arrays may be
            longer than that, and are other ones after an `append`.
        stride: words of a point in `bits`.
    """

    def __init__(self, point_count: int, device: wp.Device):
        """No candidates yet."""
        self.device, self.point_count = device, point_count
        self.sizes = np.zeros(0, np.int64)
        self.points = wp.empty(1, dtype=int, device=device)
        self.edges = wp.zeros(1, dtype=int, device=device)
        self.stride, self._bits, self._packed = 0, wp.empty(1, dtype=wp.uint32, device=device), 0

    @property
    def count(self) -> int:
        """Candidates."""
        return len(self.sizes)

    @property
    def group_count(self) -> int:
        """Groups of candidates that threads count for."""
        return -(-self.count // GROUP)

    def append(self, masks: np.ndarray) -> None:
        """Further candidates, `masks` (k, words) uint32, as from `masks_of`."""
        begin = self.count
        self._extend(np.bitwise_count(masks).sum(1, dtype=np.int64))
        flat = wp.array(np.ascontiguousarray(masks).ravel(), dtype=wp.uint32, device=self.device)
        launch(
            list_points_kernel,
            len(masks),
            [flat, masks.shape[1], self.edges, begin],
            [self.points],
            self.device,
            seconds_per_thread=1e-5,
        )

    def append_from(self, other: CandidateCoverage, chosen: np.ndarray) -> None:
        """Further candidates: the `chosen` ones (k,) of other holdings of the same points."""
        begin = int(self.sizes.sum())
        self._extend(other.sizes[chosen])
        if len(chosen):
            edges, points = other.edges.numpy(), other.points.numpy()
            lists = np.concatenate([points[edges[k] : edges[k + 1]] for k in chosen])
            wp.copy(self.points, wp.array(lists, dtype=int, device=self.device), begin, 0, len(lists))

    def _extend(self, sizes: np.ndarray) -> None:
        """Make room for candidates of these sizes."""
        before = int(self.sizes.sum())
        self.sizes = np.append(self.sizes, sizes)
        edges = np.append(0, np.cumsum(self.sizes))
        self.edges = wp.array(edges.astype(np.int32), dtype=int, device=self.device)
        if edges[-1] > self.points.shape[0]:
            wider = wp.empty(int(1.5 * edges[-1]), dtype=int, device=self.device)
            wp.copy(wider, self.points, 0, 0, before)
            self.points = wider

    def truncate(self, count: int) -> None:
        """Forget all candidates but the first `count`."""
        self._toggle(count, self._packed)
        self._packed = min(self._packed, count)
        self.sizes = self.sizes[:count]

    def drop_first(self, count: int) -> None:
        """Forget the first `count` candidates."""
        lists = self.points.numpy()[self.sizes[:count].sum() : self.sizes.sum()].copy()
        self.sizes = self.sizes[count:]
        self.points = wp.array(lists, dtype=int, device=self.device)
        self.stride, self._packed = 0, 0
        self._extend(self.sizes[:0])

    def bits(self) -> wp.array:
        """A row of `stride` words for each point: bit k says whether candidate k holds it."""
        if self.count > WORD * self.stride:
            self.stride = GROUP // WORD * -(-(self.count + self.count // 2) // GROUP)
            self._bits = wp.zeros(self.point_count * self.stride, dtype=wp.uint32, device=self.device)
            self._packed = 0
        self._toggle(self._packed, self.count)
        self._packed = self.count
        return self._bits

    def _toggle(self, begin: int, end: int) -> None:
        """Set or clear the bits of the candidates from `begin` to `end`."""
        if begin < end:
            launch(
                toggle_bits_kernel,
                (end - 1) // WORD - begin // WORD + 1,
                [self.edges, self.points, begin, end, self.stride],
                [self._bits],
                self.device,
                seconds_per_thread=5e-5,
            )

    def common(self, candidates: Sequence[int]) -> np.ndarray:
        """Points that candidates share with each of all: (candidates asked for, count) int32."""
        bits = self.bits()
        asked = wp.array(np.array(candidates, np.int32), dtype=int, device=self.device)
        size = self.group_count * GROUP
        common = wp.empty(max(1, len(candidates) * size), dtype=int, device=self.device)
        launch(
            count_common_kernel,
            len(candidates) * self.group_count,
            [asked, self.edges, self.points, bits, self.stride, self.group_count],
            [common],
            self.device,
            seconds_per_thread=5e-6,
        )
        return common.numpy()[: len(candidates) * size].reshape(-1, max(1, size))[:, : self.count]


def hold(bits: np.ndarray, device: wp.Device) -> CandidateCoverage:
    """Holdings of candidates from `bits` (candidates, n) bool."""
    coverage = CandidateCoverage(bits.shape[1], device)
    coverage.append(masks_of(bits))
    return coverage
