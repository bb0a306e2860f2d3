"""Lists of grid cells on the device: packed coordinates, selection of what is kept, splitting into eight.

Coarse-to-fine work on a grid keeps a list of cubic blocks of cells. A block of `size` cells a side is named
by its corner divided by `size`, packed into one integer; halving `size` turns each kept block into eight.
The lists have no duplicates and a fixed order (by parent, then octant): results do not depend on the number
of cores.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from ..runtime.launch import PLAIN_OPTIONS, launch

wp.set_module_options(PLAIN_OPTIONS)

COORDINATE_LIMIT = 1024
"""Cells along an axis are fewer than or as many as this: a packed coordinate has 10 bits."""


@wp.func
def pack_cell(x: int, y: int, z: int) -> int:
    """One integer for three coordinates in [0, 1023]."""
    return (x << 20) | (y << 10) | z


@wp.func
def unpack_cell(cell: int) -> wp.vec3i:
    """The three coordinates of a packed cell."""
    return wp.vec3i(cell >> 20, (cell >> 10) & 1023, cell & 1023)


def all_blocks(resolution: int, size: int, device: wp.Device) -> wp.array:
    """Every block of `size`^3 cells that a grid of `resolution`^3 touches, packed int32; some may stick
    out."""
    side = np.arange(-(-resolution // size), dtype=np.int32)
    packed = (side[:, None, None] << 20) | (side[:, None] << 10) | side
    return wp.array(packed.ravel(), dtype=int, device=device)


def flat_nonzero(keep: wp.array[int]) -> wp.array:
    """Indices at which `keep` (0 or 1) is 1, ascending, int32. Reads one number back from the device."""
    ends = wp.empty_like(keep)
    wp.utils.array_scan(keep, ends, inclusive=True)
    count = int(ends[-1:].numpy()[0]) if len(keep) else 0
    kept = wp.empty(count, dtype=int, device=keep.device)
    if count:
        launch(place_kept_kernel, len(keep), [keep, ends], [kept], keep.device, seconds_per_thread=1e-9)
    return kept


def split_blocks(blocks: wp.array[int], kept: wp.array[int]) -> wp.array:
    """The eight parts of block `blocks[kept[i]]`, at indices 8 i to 8 i + 7; some may lie outside the
    grid."""
    halves = wp.empty(8 * len(kept), dtype=int, device=blocks.device)
    launch(split_blocks_kernel, len(halves), [blocks, kept], [halves], blocks.device, seconds_per_thread=2e-9)
    return halves


@wp.kernel
def place_kept_kernel(
    first: int,
    keep: wp.array[int],
    ends: wp.array[int],
    # outputs
    out_kept: wp.array[int],
):
    i = first + wp.tid()
    if keep[i] != 0:
        out_kept[ends[i] - 1] = i


@wp.kernel
def split_blocks_kernel(
    first: int,
    blocks: wp.array[int],
    kept: wp.array[int],
    # outputs
    out_halves: wp.array[int],
):
    i = first + wp.tid()
    block = unpack_cell(blocks[kept[i >> 3]])
    out_halves[i] = pack_cell(
        2 * block[0] + ((i >> 2) & 1), 2 * block[1] + ((i >> 1) & 1), 2 * block[2] + (i & 1)
    )
