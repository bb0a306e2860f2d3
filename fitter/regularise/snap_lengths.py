"""Sizes and coordinates of primitives that are nearly equal made equal."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ...kernels.primitives import family
from ...kernels.rows import SHAPES, TRANSLATION
from .transaction import Claim, Transaction

NEAR_SIZE = 0.05
"""Relative difference up to which sizes are tried as equal."""

NEAR_PLACE = 0.015
"""Difference up to which coordinates of centres are, normalised: 0.8 % of the longest side."""

Place = tuple[int, int]
"""Index of a primitive and a column of its row."""


def snap_sizes(transaction: Transaction) -> None:
    """First parts that are alike in all their sizes, then single sizes."""
    free = transaction.free()
    used: set[int] = set()
    for place, index in enumerate(free):
        if index in used:
            continue
        sizes = _sizes(transaction, index)
        alike = [index]
        for other in free[place + 1 :]:
            if transaction.families[other] != transaction.families[index]:
                continue
            theirs = _sizes(transaction, other)
            near = np.abs(sizes - theirs) <= NEAR_SIZE * np.maximum(sizes, theirs)
            if other not in used and near.all():
                alike.append(other)
        if len(alike) > 1 and _same_sizes(transaction, alike):
            used.update(alike)
    places = [(index, column) for index in free for column in _size_columns(transaction, index)]
    for group in _clusters(transaction.rows, places, relative=NEAR_SIZE, absolute=0.0):
        if len({transaction.rows[place].tobytes() for place in group}) > 1:
            _equal(transaction, group, "size")


def snap_centres(transaction: Transaction) -> None:
    """Coordinates of centres along the mesh's axes: coaxial parts, parts in a row, parts on the middle plane."""
    free = transaction.free()
    for axis in range(3):
        places = [(index, TRANSLATION + axis) for index in free]
        for group in _clusters(transaction.rows, places, relative=0.0, absolute=NEAR_PLACE):
            if not _equal(transaction, group, "centre"):
                for first, second in pairwise(group):
                    _equal(transaction, [first, second], "centre")


def _same_sizes(transaction: Transaction, alike: Sequence[int]) -> bool:
    """Give several parts of one family the mean of their sizes."""
    columns = _size_columns(transaction, alike[0])

    def change(rows: np.ndarray) -> np.ndarray:
        rows[np.ix_(alike, columns)] = _mean(rows[np.ix_(alike, columns)])
        return rows

    def value(rows: np.ndarray) -> list[float]:
        return [float(number) for number in rows[alike[0], columns]]

    parts = sorted({follower for index in alike for follower in transaction.constraints.followers(index)})
    return transaction.attempt(change, Claim("size", tuple(parts), "all", value))


def _size_columns(transaction: Transaction, index: int) -> list[int]:
    """Columns of a row that tell how large the primitive is."""
    return [SHAPES + column for column in family(transaction.families[index]).sides]


def _sizes(transaction: Transaction, index: int) -> np.ndarray:
    return transaction.rows[index, _size_columns(transaction, index)]


def _equal(transaction: Transaction, group: Sequence[Place], kind: str) -> bool:
    """Give several numbers their mean; a centre on the middle plane of the box stays there."""
    rows_of, columns = [list(entry) for entry in zip(*group, strict=True)]

    def change(rows: np.ndarray) -> np.ndarray:
        numbers = rows[rows_of, columns]
        fixed = kind == "centre" and (numbers == 0.0).any()
        rows[rows_of, columns] = 0.0 if fixed else _mean(numbers)
        return rows

    def value(rows: np.ndarray) -> dict[str, object]:
        number = float(rows[group[0]])
        if kind == "size":
            return {"length": number}
        return {"axis": "xyz"[columns[0] - TRANSLATION], "at": number}

    return transaction.attempt(change, Claim(kind, tuple(sorted(set(rows_of))), tuple(group), value))


def _mean(numbers: np.ndarray) -> np.ndarray:
    """Mean over the first axis, which equal numbers are to the last bit."""
    if (numbers == numbers[:1]).all():
        return numbers[0]
    return numbers.mean(axis=0, dtype=np.float64).astype(np.float32)


def _clusters(
    rows: np.ndarray, places: Sequence[Place], relative: float, absolute: float
) -> list[list[Place]]:
    """Groups of two and more places whose numbers lie within a tolerance of the group's least."""
    ordered = sorted(places, key=lambda place: (float(rows[place]), place))
    groups: list[list[Place]] = []
    for place in ordered:
        number = float(rows[place])
        if groups:
            least = float(rows[groups[-1][0]])
            if number - least <= max(relative * abs(number), absolute):
                groups[-1].append(place)
                continue
        groups.append([place])
    return [group for group in groups if len(group) > 1]
