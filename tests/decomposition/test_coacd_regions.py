"""The convex decomposition as an option: regions of a residual, and a plain sentence where the package is missing."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from resfit.decomposition.proposals.coacd import PROPOSAL
from resfit.decomposition.propose import find_parts, largest_parts
from resfit.decomposition.region import Region
from resfit.decomposition.target_cells import target_cells
from resfit.errors import InputError
from resfit.kernels.runtime.launch import serial_device


def l_shape() -> np.ndarray:
    """Signed distances of an L of two bars on a 32^3 grid, coarse but negative inside."""
    centre = (np.arange(32) + 0.5) / 16 - 1
    x, y, z = np.meshgrid(centre, centre, centre, indexing="ij")
    upright = np.maximum(np.maximum(np.abs(x + 0.5) - 0.2, np.abs(y) - 0.8), np.abs(z) - 0.2)
    lying = np.maximum(np.maximum(np.abs(x) - 0.7, np.abs(y + 0.6) - 0.2), np.abs(z) - 0.2)
    return np.minimum(upright, lying).astype(np.float32)


def convex_regions(grid: np.ndarray, explained: np.ndarray | None = None) -> list[Region]:
    parts = find_parts(
        target_cells(grid),
        explained,
        first_round=True,
        device=serial_device(),
        proposals=[PROPOSAL],
    )
    return largest_parts(parts, 64)


def test_an_l_is_cut_into_its_bars():
    pytest.importorskip("coacd", reason="the optional package coacd is not installed")
    grid = l_shape()
    regions = convex_regions(grid)
    assert 2 <= len(regions) <= 4
    covered = np.zeros(grid.shape, bool)
    for region in regions:
        box = tuple(slice(low, low + size) for low, size in zip(region.lower, region.mask.shape, strict=True))
        covered[box] |= region.mask
    assert (covered & (grid < 0)).sum() > 0.9 * (grid < 0).sum()
    again = convex_regions(grid)
    assert [region.volume for region in regions] == [region.volume for region in again]


def test_nothing_left_is_no_region():
    assert convex_regions(l_shape(), l_shape() - 0.2) == []


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "coacd", None)
    with pytest.raises(
        InputError, match=r"coacd.*not installed; call .* -m pip install 'coacd>=.*to get it\.$"
    ):
        convex_regions(l_shape())
