"""Parts of a target that primitives hold: which cells, who touches whom, and what is proposed of them."""

from __future__ import annotations

import numpy as np
import pytest
from voxel_solids import ball, box, grid, paint

from resfit.decomposition.region import Region, true_box
from resfit.decomposition.target_cells import target_cells
from resfit.fitter.propose.split_merge import (
    Parts,
    coarse_cells,
    divide,
    halves,
    neighbour_pairs,
    part_regions,
)

PLACES = np.array([[-0.5, 0, 0], [0.1, 0, 0], [0.6, 0, 0], [0.9, 0.9, 0.9]])
"""Whoever is nearest of these holds a cell; nobody is near the last one."""


@pytest.fixture(scope="module")
def solid() -> np.ndarray:
    return grid(box((-0.9, -0.21, -0.3), (0.8, 0.17, 0.33)), ball((0.5, 0.2, 0), 0.35))


@pytest.fixture(scope="module")
def labels(solid: np.ndarray) -> np.ndarray:
    """The part of each cell, cell by cell from its coarse cell's centre; -1 outside."""
    half = len(solid) // 2
    centres = (np.stack(np.indices((half,) * 3), -1) + 0.5) * (2.0 / half) - 1.0
    nearest = np.linalg.norm(centres[..., None, :] - PLACES, axis=-1).argmin(-1)
    return np.where(solid < 0, nearest.repeat(2, 0).repeat(2, 1).repeat(2, 2), -1)


@pytest.fixture(scope="module")
def parts(solid: np.ndarray) -> Parts:
    target = target_cells(solid)
    coarse = coarse_cells(target)
    owner = np.linalg.norm(coarse.centres[:, None] - PLACES, axis=-1).argmin(-1)
    return divide(target, owner.astype(np.int32)[coarse.around], len(PLACES))


def test_parts_are_the_cells_nearest_to_each_primitive(parts: Parts, labels: np.ndarray) -> None:
    found = part_regions(parts, [(0,), (1,), (2,), (3,), (0, 2), (1, 3)], "part")
    assert len(found) == 5, "the part without cells is left out"
    for region, group in zip(found, [(0,), (1,), (2,), (0, 2), (1,)], strict=True):
        assert (paint(region) == np.isin(labels, group)).all()
        assert true_box(region.mask) == tuple(slice(0, size) for size in region.mask.shape)


def test_pairs_are_those_that_touch_by_their_contact(parts: Parts, labels: np.ndarray) -> None:
    contact = np.zeros((4, 4))
    for axis in range(3):
        turned = np.moveaxis(labels, axis, 0)
        for a, b in ((0, 1), (1, 2), (0, 2)):
            contact[a, b] += ((turned[:-1] == a) & (turned[1:] == b)).sum()
            contact[a, b] += ((turned[:-1] == b) & (turned[1:] == a)).sum()
    assert (np.triu(parts.survey.contacts + parts.survey.contacts.T) == contact).all()
    pairs = neighbour_pairs(parts)
    assert sorted(pairs) == [(0, 1), (1, 2)]
    share = [contact[pair] / min(parts.sizes[pair[0]], parts.sizes[pair[1]]) ** (2 / 3) for pair in pairs]
    assert share == sorted(share, reverse=True)


def test_halves_are_cut_across_the_two_longest_axes() -> None:
    mask = np.ones((30, 10, 4), bool)
    found = halves(Region(np.array([3, 4, 5]), mask, 64, "part"))
    assert [tuple(half.mask.shape) for half in found] == [(15, 10, 4)] * 2 + [(30, 5, 4)] * 2
    assert sorted(tuple(half.lower.tolist()) for half in found) == [
        (3, 4, 5),
        (3, 4, 5),
        (3, 9, 5),
        (18, 4, 5),
    ]
    assert {half.source for half in found} == {"half part"}
    assert not halves(Region(np.array([0, 0, 0]), mask[:4, :4, :2], 64, "part")), (
        "halves of 16 cells are too small"
    )
