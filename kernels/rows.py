"""A primitive as one row of floats: the layout that every kernel, the fitter and the assembly share.

An assembly of K primitives is one flat float32 array of K * ROW values, primitive-major, in the normalised frame.
`translation` is the primitive's centre; `rotation` a unit quaternion (w, x, y, z), local to world; `shape` the
family's parameters in the order of its table, padded with zeros to SHAPE; `blend` the smooth-union radius with what
stands before it in the list; `gate` the existence in [0, 1] (superfrustum.md, "Gate"), 1 for a primitive that is there.
"""

from __future__ import annotations

import numpy as np
import warp as wp

SHAPE = 8
"""Shape parameters a row has room for: SuperFrustum's 8 are the most of any family."""
ROW = 3 + 4 + SHAPE + 2
TRANSLATION, ROTATION, SHAPES, BLEND, GATE = 0, 3, 7, 7 + SHAPE, 8 + SHAPE

TANGENT = 3 + 3 + SHAPE
"""Columns of a Jacobian row: local translation (3), local rotation (3), shape (SHAPE).

An increment d moves a primitive by translation += R d[0:3], rotation = rotation * exp(d[3:6]), shape += d[6:].
Local increments have no singularity and need no world rotation in the point loop."""


def empty_rows(primitive_count: int) -> np.ndarray:
    """Rows (primitive_count, ROW) float32 of primitives at the origin, unrotated, shape 0, blend 0, gate 1."""
    rows = np.zeros((primitive_count, ROW), np.float32)
    rows[:, ROTATION] = 1.0
    rows[:, GATE] = 1.0
    return rows


ROW_C = wp.constant(ROW)
SHAPE_C = wp.constant(SHAPE)
TRANSLATION_C, ROTATION_C = wp.constant(TRANSLATION), wp.constant(ROTATION)
SHAPES_C, BLEND_C, GATE_C = wp.constant(SHAPES), wp.constant(BLEND), wp.constant(GATE)

DERIVATIVES = 4 + SHAPE
DERIVATIVES_C = wp.constant(DERIVATIVES)
Derivatives = wp.types.vector(length=DERIVATIVES, dtype=float)
"""What a family's `sdf_grad` returns: the distance, its derivatives to the local point (3) and to the shape (SHAPE)."""
