"""Some cells of a grid as a list: what is done to them takes time by their number, not by the grid's.

What an assembly leaves unexplained is often a thousand cells scattered over a grid of a million. Kernels that follow
neighbours are chains of dependent steps, so that they always run as one thread on the CPU. Not differentiable.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import warp as wp

from ..runtime.launch import PLAIN_OPTIONS, launch

wp.set_module_options(PLAIN_OPTIONS)

BORDER = 3
"""Empty cells round the grid, so that a few steps along an axis need no look at where the grid ends."""

BLOCK = 64
"""Cells a thread measures in one loop, which so becomes vector code."""


class CellSet:
    """Some cells of a grid, in its order. The place of a cell is its number in that order.

    Attributes:
        shape: (a, b, c) of the grid.
        index: (3, m) int32, the cells' coordinates.
    """

    def __init__(self, index: np.ndarray, shape: tuple[int, ...]):
        """Of coordinates (3, m) int32, in order, in a grid of a shape."""
        self.shape, self.index = shape, index
        bordered = [size + 2 * BORDER for size in shape]
        self.strides = np.array([bordered[1] * bordered[2], bordered[2], 1], np.int32)
        self._flat = sum(step * (line + BORDER) for step, line in zip(self.strides, self.index, strict=True))
        self._place_at = np.full(np.prod(bordered), -1, np.int32)
        self._place_at[self._flat] = np.arange(len(self), dtype=np.int32)

    def __len__(self) -> int:
        return len(self._flat)

    def all_places(self) -> np.ndarray:
        """0 to m - 1, int32."""
        return np.arange(len(self), dtype=np.int32)

    def at(self, places: np.ndarray) -> np.ndarray:
        """Coordinates (3, k) int32 of some cells; contiguous along each axis, as `index[:, places]` would not be."""
        return self.index.take(places, axis=1)

    def crop(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The box of some cells, at least one: its lower corner (3,) int32, and a mask on it of the cells."""
        return crop(self.at(places))

    def beside(self, axis: int, step: int) -> np.ndarray:
        """Place (m,) int32 of the cell that is `step` further along an axis, at most BORDER; -1 where none is."""
        return self._place_at[self._flat + step * self.strides[axis]]

    @cached_property
    def arrays(self) -> tuple[wp.array, wp.array, wp.vec3i]:
        """CPU kernel arguments: the index into the bordered grid of each place, the other way round, and
        the strides of the bordered grid."""
        return on_cpu(self._flat), on_cpu(self._place_at), wp.vec3i(*self.strides)

    def run_lengths(self) -> np.ndarray:
        """Number of cells (3, m) int32 in the unbroken run along each axis that a cell is in."""
        flat, place_at, strides = self.arrays
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


def cells_of(mask: np.ndarray) -> CellSet:
    """The true cells of a mask (a, b, c)."""
    return CellSet(true_cells(mask), mask.shape)


def true_cells(mask: np.ndarray) -> np.ndarray:
    """Coordinates (3, m) int32 of the true cells of a mask (a, b, c), in the order of the grid."""
    return coordinates(np.flatnonzero(mask), mask.shape)


def coordinates(flat: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Coordinates (3, m) int32 of cells by their flat indices (m,) into a grid."""
    # NumPy divides narrow numbers by one number several times as fast as `unravel_index` does.
    flat = flat.astype(np.int32)
    row = flat // shape[2]
    x = row // shape[1]
    return np.stack([x, row - x * shape[1], flat - row * shape[2]])


def crop(index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The box of cells (3, k), at least one: its lower corner (3,) int32, and a mask on it of the cells."""
    lower = index.min(axis=1)
    mask = np.zeros(index.max(axis=1) + 1 - lower, bool)
    x, y, z = index - lower[:, None]
    mask.reshape(-1)[(x * mask.shape[1] + y) * mask.shape[2] + z] = True
    return lower, mask


@dataclass(frozen=True)
class Survey:
    """Bounding boxes and contacts of the parts of a set of cells."""

    contacts: np.ndarray
    """(parts, parts) int32, faces that a cell of one part and the next cell, of the other, share; 0 on the diagonal."""
    lower: np.ndarray
    upper: np.ndarray
    """(parts, 3) int32 each, the box [lower, upper) of a part; upper is 0 where a part has no cells."""


def survey_parts(cells: CellSet, part: np.ndarray, count: int) -> Survey:
    """Bounding boxes and contacts of `count` parts, given the part (m,) int32 of each cell."""
    flat, place_at, strides = cells.arrays
    contacts = np.zeros((count, count), np.int32)
    lower, upper = np.full((count, 3), max(cells.shape), np.int32), np.zeros((count, 3), np.int32)
    launch(
        survey_parts_kernel,
        1,
        [on_cpu(part), count, on_cpu(cells.index.reshape(-1)), flat, place_at, strides],
        [on_cpu(found.reshape(-1)) for found in (contacts, lower, upper)],
        flat.device,
    )
    return Survey(contacts, lower, upper)


def on_cpu(values: np.ndarray) -> wp.array:
    """A Warp array in the memory of a contiguous NumPy array (n,) int32."""
    return wp.array(values, dtype=int, device="cpu", copy=False)


def squared_distances(index: np.ndarray, others: np.ndarray, device: wp.Device) -> np.ndarray:
    """Squared distance (k,) float32 from each of some cells (3, k) to the nearest of others (3, s), in cells."""
    count = index.shape[1]
    padded = np.zeros((3, -(-count // BLOCK) * BLOCK), np.float32)
    padded[:, :count] = index
    square = wp.empty(padded.shape[1], dtype=float, device=device)
    lines = [*padded, others.astype(np.float32, order="C").reshape(-1)]
    launch(
        measure_squares_kernel,
        padded.shape[1] // BLOCK,
        [wp.array(line, dtype=float, device=device, copy=False) for line in lines],
        [square],
        device,
        seconds_per_thread=others.shape[1] * BLOCK * 2e-10,
    )
    return square.numpy()[:count]


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
def survey_parts_kernel(
    first: int,
    part: wp.array[int],
    count: int,
    index: wp.array[int],
    flat: wp.array[int],
    place_at: wp.array[int],
    strides: wp.vec3i,
    # outputs
    out_contacts: wp.array[int],
    out_lower: wp.array[int],
    out_upper: wp.array[int],
):
    """Boxes of all parts, and the contacts of each cell with the next ones along the axes; a single thread."""
    cells = part.shape[0]
    for k in range(cells):
        own = part[k]
        for axis in range(3):
            at = index[axis * cells + k]
            out_lower[3 * own + axis] = wp.min(out_lower[3 * own + axis], at)
            out_upper[3 * own + axis] = wp.max(out_upper[3 * own + axis], at + 1)
            other = place_at[flat[k] + strides[axis]]
            if other >= 0 and part[other] != own:
                out_contacts[own * count + part[other]] += 1


@wp.kernel
def measure_squares_kernel(
    first: int,
    x: wp.array[float],
    y: wp.array[float],
    z: wp.array[float],
    others: wp.array[float],
    # outputs
    out_square: wp.array[float],
):
    """Squared distance of the nearest other cell for a block of cells; whole numbers, exact in float32."""
    base = (first + wp.tid()) * BLOCK
    count = others.shape[0] // 3
    for j in range(BLOCK):
        out_square[base + j] = 3.0e38
    for k in range(count):
        other_x = others[k]
        other_y = others[count + k]
        other_z = others[2 * count + k]
        for j in range(BLOCK):
            dx = x[base + j] - other_x
            dy = y[base + j] - other_y
            dz = z[base + j] - other_z
            square = dx * dx + dy * dy + dz * dz
            out_square[base + j] = wp.where(square < out_square[base + j], square, out_square[base + j])
