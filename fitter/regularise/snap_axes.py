"""Axes of primitives that are nearly parallel to those of the mesh, or to each other's, made so."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from ...kernels.primitives import family
from ...kernels.rotation import matrix_of, multiply, quaternion_of
from ...kernels.rows import ROTATION
from .canonical import is_box, is_prism, is_round, is_straight, shape_of
from .constraints import tidy, turn_between
from .rigid_motion import canonical_sign
from .transaction import Change, Claim, Transaction

NEAR = np.radians(8.0)
"""Directions nearer than this are tried as parallel."""

ROTATIONS = [
    canonical_sign(quaternion_of(matrix))
    for order in permutations(range(3))
    for signs in product((1.0, -1.0), repeat=3)
    if np.linalg.det(matrix := np.eye(3)[list(order)] * np.array(signs)[:, None]) > 0
]
"""The 24 rotations of the cube, as quaternions."""


def snap_axes(transaction: Transaction) -> None:
    """All three axes along the mesh's where they nearly are, else one; then parallel to one another."""
    loose = []
    for index in transaction.free():
        if not _to_mesh(transaction, index):
            loose.append(index)
    for place, index in enumerate(loose):
        for other in loose[:place]:
            if _to_other(transaction, index, other):
                break


def _set_rotation(index: int, quaternion: np.ndarray) -> Change:
    def change(rows: np.ndarray) -> np.ndarray:
        rows[index, ROTATION : ROTATION + 4] = quaternion
        return rows

    return change


def _to_mesh(transaction: Transaction, index: int) -> bool:
    """Line a primitive up with the mesh's axes: all of its axes, else its sweep, else another."""
    row, name = transaction.rows[index], transaction.families[index]
    own = row[ROTATION : ROTATION + 4].astype(np.float64)
    parts = tuple(transaction.constraints.followers(index))
    nearest = max(ROTATIONS, key=lambda quaternion: abs(float(quaternion @ own)))
    angle = 2.0 * np.arccos(min(1.0, abs(float(nearest @ own))))
    if angle < NEAR:
        claim = _said("axis", parts, "along the mesh's axes")
        if transaction.attempt(_box_as_it_stands(index, nearest, name), claim):
            return True
    matrix = matrix_of(own)
    # Of a body of revolution only the sweep counts.
    for axis in (2,) if is_round(row, name, 0.02) else (2, 0, 1):
        world = int(np.abs(matrix[:, axis]).argmax())
        direction = np.eye(3)[world] * np.sign(matrix[world, axis])
        if np.arccos(min(1.0, float(direction @ matrix[:, axis]))) >= NEAR:
            continue
        turned = tidy(multiply(turn_between(matrix[:, axis], direction), own))
        if axis == 2 and is_round(row, name, 0.02):
            turned = max(
                (q for q in ROTATIONS if np.allclose(matrix_of(q)[:, 2], direction)),
                key=lambda q: (abs(float(q @ own)), tuple(q)),
            )
        value = {"axis": "xyz"[axis], "along": "xyz"[world]}
        if transaction.attempt(_set_rotation(index, turned), _said("axis", parts, value)):
            return True
    return False


def _box_as_it_stands(index: int, quaternion: np.ndarray, name: str) -> Change:
    """Turn a primitive; a box gets no rotation and its sizes in the order of the mesh's axes instead."""
    order = np.abs(matrix_of(quaternion)).argmax(axis=1)

    def change(rows: np.ndarray) -> np.ndarray:
        turned = quaternion
        if is_box(rows[index], name):
            # Once done, the sizes are in order: a second time nothing changes.
            if not np.array_equal(rows[index, ROTATION : ROTATION + 4], ROTATIONS[0].astype(np.float32)):
                size = shape_of(rows[index])[family(name).columns("size")]
                size[:] = size[order]
            turned = ROTATIONS[0]
        rows[index, ROTATION : ROTATION + 4] = turned
        return rows

    return change


def _to_other(transaction: Transaction, index: int, other: int) -> bool:
    """Give a primitive the orientation of another, in whichever position of the cube is nearest; else its sweep."""
    own, theirs = (transaction.rows[k, ROTATION : ROTATION + 4].astype(np.float64) for k in (index, other))
    name = transaction.families[index]
    parts = tuple(sorted({index, other}))
    nearest = max(
        (multiply(theirs, turn) for turn in ROTATIONS), key=lambda quaternion: abs(float(quaternion @ own))
    )
    if 2.0 * np.arccos(min(1.0, abs(float(nearest @ own)))) < NEAR:
        turn = tidy(nearest)
        if transaction.attempt(_set_rotation(index, turn), _said("axis", parts, "parallel axes")):
            return True
    a, b = matrix_of(own)[:, 2], matrix_of(theirs)[:, 2]
    either = is_straight(transaction.rows[index], name) and is_prism(transaction.rows[index], name)
    if a @ b < 0 and either:
        b = -b
    if np.arccos(np.clip(float(a @ b), -1.0, 1.0)) >= NEAR:
        return False
    turned = tidy(multiply(turn_between(a, b), own))
    return transaction.attempt(_set_rotation(index, turned), _said("axis", parts, "parallel sweeps"))


def _said(kind: str, parts: tuple[int, ...], value: object) -> Claim:
    """A claim about directions, which no later change moves."""
    return Claim(kind, parts, str(value), lambda rows: value)
