"""Lists of blocks of cells: packing, selection and splitting, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from resfit.kernels.grid.block_list import all_blocks, flat_nonzero, split_blocks


def unpacked(blocks: wp.array) -> np.ndarray:
    """Coordinates (n, 3) of packed blocks."""
    packed = blocks.numpy()
    return np.stack([packed >> 20, (packed >> 10) & 1023, packed & 1023], axis=1)


@pytest.mark.parametrize(("resolution", "size", "side"), [(16, 4, 4), (17, 4, 5), (3, 4, 1)])
def test_blocks_cover_the_grid_once(resolution: int, size: int, side: int, device: wp.Device) -> None:
    found = unpacked(all_blocks(resolution, size, device))
    np.testing.assert_array_equal(found, np.argwhere(np.ones((side,) * 3)))


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_indices_of_what_is_kept(share: float, device: wp.Device, rng: np.random.Generator) -> None:
    keep = (rng.uniform(size=5000) < share).astype(np.int32)
    found = flat_nonzero(wp.array(keep, dtype=int, device=device))
    np.testing.assert_array_equal(found.numpy(), np.flatnonzero(keep))


def test_nothing_of_nothing_is_kept(device: wp.Device) -> None:
    assert len(flat_nonzero(wp.empty(0, dtype=int, device=device))) == 0


def test_a_block_splits_into_its_eight_parts(device: wp.Device) -> None:
    blocks = all_blocks(64, 2, device)
    kept = np.array([0, 30_000, len(blocks) - 1])
    halves = unpacked(split_blocks(blocks, wp.array(kept, dtype=int, device=device)))
    octants = np.argwhere(np.ones((2, 2, 2)))
    expected = 2 * unpacked(blocks)[kept][:, None] + octants
    np.testing.assert_array_equal(halves, expected.reshape(-1, 3))
