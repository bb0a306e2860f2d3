"""Query points as the kernels want them: separate coordinate arrays, padded to whole blocks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import warp as wp

from ..runtime.launch import PLAIN_OPTIONS, launch

wp.set_module_options(PLAIN_OPTIONS)

BLOCK = 64
"""Points a thread handles in one loop: enough for LLVM to vectorise (it unrolls loops of 16 and less)."""
BLOCK_C = wp.constant(BLOCK)


@wp.struct
class Points:
    """Coordinates of points as an argument of kernels: each (block_count * BLOCK,), normalised frame."""

    x: wp.array[float]
    y: wp.array[float]
    z: wp.array[float]


@wp.func_native("return numbers.data[i];")
def at(numbers: wp.array[float], i: int) -> float:
    """A number of an array without gaps. Warp knows that arguments of kernels have none, of fields it does not, and
    then no loop becomes vector code."""


def points_argument(x: wp.array, y: wp.array, z: wp.array) -> Any:
    """Coordinate arrays as one argument of a kernel."""
    points = Points()
    points.x, points.y, points.z = x, y, z
    return points


@dataclass(frozen=True)
class PointBlocks:
    """Points in the normalised frame: x, y, z each (block_count * BLOCK,) float32 on one device.

    The last point is repeated in the padding, so that a block's bounding sphere stays tight.
    """

    x: wp.array
    y: wp.array
    z: wp.array
    count: int
    """Points asked for, without padding."""

    @property
    def block_count(self) -> int:
        """Number of blocks, padding included."""
        return self.x.shape[0] // BLOCK

    @cached_property
    def points(self) -> Any:
        """The coordinates as one argument of a kernel: a `Points`."""
        return points_argument(self.x, self.y, self.z)

    @property
    def device(self) -> wp.Device:
        """Device of the coordinates."""
        return self.x.device


def padded_count(count: int) -> int:
    """`count` rounded up to whole blocks."""
    return -(-count // BLOCK) * BLOCK


def point_blocks(points: np.ndarray, device: wp.Device) -> PointBlocks:
    """Blocks of the points (n, 3) in their given order. Neighbours in the list should be neighbours in space."""
    points = np.asarray(points)
    padding = padded_count(len(points)) - len(points)
    columns = []
    for axis in range(3):
        column = np.asarray(points[:, axis], np.float32)
        if padding:
            column = np.concatenate([column, np.full(padding, column[-1], np.float32)])
        columns.append(wp.array(np.ascontiguousarray(column), dtype=float, device=device))
    return PointBlocks(*columns, count=len(points))


CUBE = 4
"""Side of the cubes of grid points that make a block: CUBE^3 = BLOCK."""


@wp.kernel
def fill_grid_kernel(
    first: int,
    lower: wp.vec3,
    spacing: float,
    cubes_y: int,
    cubes_z: int,
    # outputs
    out_x: wp.array[float],
    out_y: wp.array[float],
    out_z: wp.array[float],
):
    """Coordinates of one cube of grid points."""
    block = first + wp.tid()
    slab = cubes_y * cubes_z
    i = block / slab
    j = (block - i * slab) / cubes_z
    k = block - i * slab - j * cubes_z
    for p in range(BLOCK_C):
        q = block * BLOCK_C + p
        out_x[q] = lower[0] + spacing * float(4 * i + p / 16)
        out_y[q] = lower[1] + spacing * float(4 * j + (p / 4) % 4)
        out_z[q] = lower[2] + spacing * float(4 * k + p % 4)


def grid_blocks(
    shape: tuple[int, int, int], lower: tuple[float, float, float], spacing: float, device: wp.Device
) -> PointBlocks:
    """The points lower + spacing * (i, j, k) of a grid, a cube of CUBE^3 a block, cubes in C order.

    A shape that is no multiple of CUBE is rounded up; `from_grid_blocks` drops the surplus.
    """
    cubes = [-(-int(n) // CUBE) for n in shape]
    block_count = cubes[0] * cubes[1] * cubes[2]
    x, y, z = (wp.empty(block_count * BLOCK, dtype=float, device=device) for _ in range(3))
    launch(
        fill_grid_kernel,
        block_count,
        [wp.vec3(*lower), float(spacing), cubes[1], cubes[2]],
        [x, y, z],
        device,
        seconds_per_thread=1e-7,
    )
    return PointBlocks(x, y, z, count=block_count * BLOCK)


def from_grid_blocks(values: np.ndarray, shape: tuple[int, int, int]) -> np.ndarray:
    """Values in the order of `grid_blocks` as an array of `shape`."""
    cubes = [-(-n // CUBE) for n in shape]
    blocked = values.reshape(*cubes, CUBE, CUBE, CUBE).transpose(0, 3, 1, 4, 2, 5)
    grid = blocked.reshape(cubes[0] * CUBE, cubes[1] * CUBE, cubes[2] * CUBE)
    return np.ascontiguousarray(grid[: shape[0], : shape[1], : shape[2]])


def any_in_blocks(mask: np.ndarray) -> np.ndarray:
    """Logical or of `mask`, the grid's, over each block of `grid_blocks`: (block_count,) int32."""
    size = [-(-n // CUBE) * CUBE for n in mask.shape]
    whole = np.zeros(size, bool)
    whole[tuple(slice(0, n) for n in mask.shape)] = mask
    for axis in range(3):
        parts = [slice(None)] * 3
        found = np.zeros(1, bool)
        for offset in range(CUBE):
            parts[axis] = slice(offset, None, CUBE)
            found = found | whole[tuple(parts)]
        whole = found
    return whole.ravel().astype(np.int32)
