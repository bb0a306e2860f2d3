"""Some cells of a grid as a list: what is done to them takes time by their number, not by the grid's.

What an assembly leaves unexplained is often a thousand cells scattered over a grid of a million. Kernels that follow
neighbours are chains of dependent steps, so that they always run as one thread on the CPU. Not differentiable.
"""

from __future__ import annotations

from functools import cached_property
from itertools import product

import numpy as np
import warp as wp

from .launch import PLAIN_OPTIONS, launch

wp.set_module_options(PLAIN_OPTIONS)

BORDER = 3
"""Empty cells round the grid, so that a few steps along an axis need no look at where the grid ends."""

BLOCK = 64
"""Cells a thread measures in one loop, which so becomes vector code."""


class CellSet:
    """The true cells of a mask, in the order of its grid. The place of a cell is its number in that order.

    Attributes:
        shape: (a, b, c) of the grid.
        index: (3, m) int32, the cells' coordinates.
    """

    def __init__(self, mask: np.ndarray):
        """Of a mask (a, b, c) bool."""
        self.shape = mask.shape
        found = np.flatnonzero(mask)
        self.index = np.stack(np.unravel_index(found, mask.shape)).astype(np.int32)
        bordered = [size + 2 * BORDER for size in mask.shape]
        self._strides = np.array([bordered[1] * bordered[2], bordered[2], 1], np.int32)
        self._flat = self._strides @ (self.index + BORDER)
        self._place_at = np.full(np.prod(bordered), -1, np.int32)
        self._place_at[self._flat] = np.arange(len(found), dtype=np.int32)

    def __len__(self) -> int:
        return len(self._flat)

    def all_places(self) -> np.ndarray:
        """0 to m - 1, int32."""
        return np.arange(len(self), dtype=np.int32)

    def crop(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The box of some cells, at least one: its lower corner (3,) int32, and a mask on it of the cells."""
        index = self.index[:, places]
        lower = index.min(axis=1)
        mask = np.zeros(index.max(axis=1) + 1 - lower, bool)
        x, y, z = index - lower[:, None]
        mask.reshape(-1)[(x * mask.shape[1] + y) * mask.shape[2] + z] = True
        return lower, mask

    def beside(self, axis: int, step: int) -> np.ndarray:
        """Place (m,) int32 of the cell that is `step` further along an axis, at most BORDER; -1 where none is."""
        return self._place_at[self._flat + step * self._strides[axis]]

    @cached_property
    def arrays(self) -> tuple[wp.array, wp.array, wp.array, wp.vec3i]:
        """What kernels on the CPU need: index into the bordered grid of each place and the other way round, a scratch
        number for each place, and the strides of the bordered grid."""
        return (
            on_cpu(self._flat),
            on_cpu(self._place_at),
            wp.empty(len(self), dtype=int, device="cpu"),
            wp.vec3i(*self._strides),
        )

    def components(self, places: np.ndarray, key: np.ndarray, full: bool = False) -> tuple[np.ndarray, int]:
        """The connected parts of some of the cells.

        Args:
            places: (k,) int32, ascending: the cells to look at.
            key: (m,) int32 of every cell of the set: neighbours are connected if their keys are equal. No cell left
                out may have the key of one looked at.
            full: whether cells that share an edge or a corner are neighbours (26), or only those that share a face (6).

        Returns:
            The part (k,) int32 of each cell, from 0 in the order of their first cells, and how many there are.
        """
        flat, place_at, parent, _ = self.arrays
        steps = _FULL_STEPS if full else _FACE_STEPS
        offsets = (steps @ self._strides).astype(np.int32)
        found, count = np.empty(len(places), np.int32), np.zeros(1, np.int32)
        launch(
            label_cells_kernel,
            1,
            [on_cpu(places), on_cpu(key), flat, place_at, on_cpu(offsets), parent],
            [on_cpu(found), on_cpu(count)],
            parent.device,
        )
        return found, int(count[0])

    def largest_components(
        self, places: np.ndarray, key: np.ndarray, smallest: int, most: int, full: bool = False
    ) -> list[np.ndarray]:
        """Places of at most `most` components, of at least `smallest` cells, largest first; see `components`."""
        if len(places) < smallest:
            return []
        found, count = self.components(places, key, full)
        volumes = np.bincount(found, minlength=count)
        chosen = np.argsort(-volumes, kind="stable")[:most]
        return [places[found == part] for part in chosen if volumes[part] >= smallest]

    def run_lengths(self) -> np.ndarray:
        """Number of cells (3, m) int32 in the unbroken run along each axis that a cell is in."""
        flat, place_at, _, strides = self.arrays
        lengths = np.empty((3, len(self)), np.int32)
        launch(
            measure_runs_kernel,
            lengths.size,
            [flat, place_at, strides],
            [on_cpu(lengths.reshape(-1))],
            flat.device,
            seconds_per_thread=4e-9,
        )
        return lengths


def on_cpu(values: np.ndarray) -> wp.array:
    """A Warp array in the memory of a contiguous NumPy array (n,) int32."""
    return wp.array(values, dtype=int, device="cpu", copy=False)


_FACE_STEPS = np.array([[-1, 0, 0], [0, -1, 0], [0, 0, -1]])
_FULL_STEPS = np.array([step for step in product((-1, 0, 1), repeat=3) if step < (0, 0, 0)])
"""Steps (k, 3) to the neighbours that come before a cell."""


def squared_distances(index: np.ndarray, others: np.ndarray, device: wp.Device) -> np.ndarray:
    """Squared distance (k,) float32 from each of some cells (3, k) to the nearest of others (3, s), in cells."""
    count = index.shape[1]
    padded = np.zeros((3, -(-count // BLOCK) * BLOCK), np.float32)
    padded[:, :count] = index
    square = wp.empty(padded.shape[1], dtype=float, device=device)
    launch(
        measure_squares_kernel,
        padded.shape[1] // BLOCK,
        [
            *(wp.array(axis, dtype=float, device=device) for axis in padded),
            *(wp.array(axis, dtype=float, device=device) for axis in others.astype(np.float32)),
        ],
        [square],
        device,
        seconds_per_thread=others.shape[1] * BLOCK * 2e-10,
    )
    return square.numpy()[:count]


@wp.func
def find_root(parent: wp.array[int], cell: int) -> int:
    """Root of a cell's tree; halves the path on the way."""
    i = cell
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@wp.kernel
def label_cells_kernel(
    first: int,
    places: wp.array[int],
    key: wp.array[int],
    flat: wp.array[int],
    place_at: wp.array[int],
    offsets: wp.array[int],
    parent: wp.array[int],
    # outputs
    out_label: wp.array[int],
    out_count: wp.array[int],
):
    """Number the connected parts; a single thread. The root of a tree is its first cell."""
    for k in range(places.shape[0]):
        cell = places[k]
        parent[cell] = cell
        root = wp.int32(cell)
        for step in range(offsets.shape[0]):
            other = place_at[flat[cell] + offsets[step]]
            if other >= 0 and key[other] == key[cell]:
                joined = find_root(parent, other)
                if joined < root:
                    parent[root] = joined
                    root = joined
                else:
                    parent[joined] = root
    count = wp.int32(0)
    for k in range(places.shape[0]):
        cell = places[k]
        if parent[cell] == cell:
            # A root's number stands where no place is: below -1.
            parent[cell] = -2 - count
            out_label[k] = count
            count += 1
        else:
            i = wp.int32(cell)
            while parent[i] >= 0:
                i = parent[i]
            out_label[k] = -2 - parent[i]
            parent[cell] = parent[i]
    out_count[0] = count


@wp.kernel
def measure_runs_kernel(
    first: int,
    flat: wp.array[int],
    place_at: wp.array[int],
    strides: wp.vec3i,
    # outputs
    out_length: wp.array[int],
):
    """The first cell of each run counts it, and writes the length for all of its cells."""
    thread = first + wp.tid()
    count = flat.shape[0]
    axis = thread // count
    begin = axis * count
    step = strides[axis]
    at = flat[thread - begin]
    if place_at[at - step] < 0:
        length = wp.int32(0)
        while place_at[at + length * step] >= 0:
            length += 1
        for k in range(length):
            out_length[begin + place_at[at + k * step]] = length


@wp.kernel
def measure_squares_kernel(
    first: int,
    x: wp.array[float],
    y: wp.array[float],
    z: wp.array[float],
    other_x: wp.array[float],
    other_y: wp.array[float],
    other_z: wp.array[float],
    # outputs
    out_square: wp.array[float],
):
    """Squared distance of the nearest other cell for a block of cells; whole numbers, exact in float32."""
    base = (first + wp.tid()) * BLOCK
    for j in range(BLOCK):
        out_square[base + j] = 3.0e38
    for k in range(other_x.shape[0]):
        ox = other_x[k]
        oy = other_y[k]
        oz = other_z[k]
        for j in range(BLOCK):
            dx = x[base + j] - ox
            dy = y[base + j] - oy
            dz = z[base + j] - oz
            square = dx * dx + dy * dy + dz * dz
            out_square[base + j] = wp.where(square < out_square[base + j], square, out_square[base + j])
