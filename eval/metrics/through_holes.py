"""Through-holes of a solid (its first Betti number), and those of a target that an assembly fills."""

from __future__ import annotations

from itertools import product

import numpy as np
import numpy.typing as npt

from ...shape.topology import find_edges, label_patches

Mask = npt.NDArray[np.bool_]


def filled_holes(faces: npt.NDArray[np.int32], target: Mask, assembly: Mask) -> int:
    """The number of through-holes of a target that an assembly fills.

    A hole counts if it is one of the target's cells, and none of the target's and the assembly's together.

    Args:
        faces: (m, 3) of the target's mesh, welded: where they form closed surfaces of genus 0, no cells are counted.
        target, assembly: (n, n, n), which cell centres are inside.
    """
    if not _may_have_holes(faces):
        return 0
    box = _box(target | assembly)
    target, together = target[box], (target | assembly)[box]
    if np.array_equal(target, together):
        return 0
    return max(0, count_through_holes(target) - count_through_holes(together))


def count_through_holes(inside: Mask) -> int:
    """First Betti number of cells (n, m, k) that hang together by faces, edges or corners."""
    from scipy.ndimage import label

    padded = np.pad(inside, 1)
    corners = np.ones((3, 3, 3), bool)
    components = int(np.asarray(label(padded, corners)[0]).max())  # type: ignore[index]
    cavities = int(np.asarray(label(~padded)[0]).max()) - 1  # type: ignore[index]
    return components + cavities - euler_characteristic(padded)


def euler_characteristic(inside: Mask) -> int:
    """Euler characteristic of the union of closed cells: vertices - edges + faces - cells.

    Args:
        inside: (n, m, k) with an empty layer around.
    """
    total = 0
    for shifts in product((0, 1), repeat=3):
        # A corner, edge or face is there if any of the cells that share it is: those along the axes shifted.
        elements = inside
        for axis, shifted in enumerate(shifts):
            if shifted:
                elements = elements | np.roll(elements, 1, axis)
        total += (-1) ** (3 - sum(shifts)) * int(np.count_nonzero(elements))
    return total


def _may_have_holes(faces: npt.NDArray[np.int32]) -> bool:
    """Genus test: True if a mesh is anything but closed surfaces of genus 0."""
    edges = find_edges(faces)
    if (edges.face_count != 2).any():
        return True
    components = int(label_patches(edges).max()) + 1
    return len(np.unique(faces)) - edges.count + len(faces) != 2 * components


def _box(inside: Mask) -> tuple[slice, ...]:
    """Slices of the bounding box of the True cells."""
    found = []
    for axis in range(3):
        there = np.flatnonzero(inside.any(axis=tuple(k for k in range(3) if k != axis)))
        found.append(slice(int(there[0]), int(there[-1]) + 1) if len(there) else slice(0, 0))
    return tuple(found)
