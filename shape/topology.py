"""Mesh topology: edges, connected patches of faces, whether they close, and their orientability."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components


@dataclass(frozen=True)
class Edges:
    """The edges of m faces: three sides each, two sides an edge where a surface is simple."""

    side_edge: np.ndarray
    """(m, 3) int, the edge that each side of a face is."""
    side_direction: np.ndarray
    """(m, 3) int8, +1 where the side runs from the lower to the higher vertex, else -1."""
    face_count: np.ndarray
    """(e,) int, sides at each edge: 1 at the rim of a hole, over 2 where sheets meet."""

    @property
    def count(self) -> int:
        """Number of edges."""
        return len(self.face_count)


def find_edges(faces: np.ndarray) -> Edges:
    """The edges of faces (m, 3)."""
    start, end = faces, np.roll(faces, -1, axis=1)
    low, high = np.minimum(start, end), np.maximum(start, end)
    key = low * (int(faces.max(initial=0)) + 1) + high
    _, edge, count = np.unique(key, return_inverse=True, return_counts=True)
    return Edges(edge.reshape(-1, 3), np.where(start < end, 1, -1).astype(np.int8), count)


def is_balanced(edges: Edges) -> bool:
    """True if every edge is passed as often one way as the other: then the mesh winds round any point a whole
    number of times, however its bodies overlap or touch."""
    sums = np.bincount(edges.side_edge.ravel(), edges.side_direction.ravel(), edges.count)
    return not sums.any()


def label_patches(edges: Edges, through_all: bool = False) -> np.ndarray:
    """Number of the patch that each face belongs to, (m,) int from 0.

    Args:
        edges: of the mesh.
        through_all: join faces across every edge; else only across those with exactly two faces, so that bodies
            which touch in an edge stay apart.
    """
    face_count = len(edges.side_edge)
    if through_all:
        rows, columns = np.repeat(np.arange(face_count), 3), edges.side_edge.ravel() + face_count
        size = face_count + edges.count
    else:
        first, second = _pairs(edges)
        rows, columns, size = first // 3, second // 3, face_count
    label = connected_labels(rows, columns, size)[:face_count]
    return np.unique(label, return_inverse=True)[1]


def connected_labels(rows: np.ndarray, columns: np.ndarray, size: int) -> np.ndarray:
    """Component (size,) of each of `size` nodes that the links rows[i] - columns[i] join."""
    graph = coo_matrix((np.ones(len(rows), bool), (rows, columns)), shape=(size, size))
    return connected_components(graph, directed=False)[1]


def label_touching(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The first box of each group of boxes that touch one another, directly or by others; (n,) int.

    Args:
        low, high: (n, 3) corners of the boxes.
    """
    count = len(low)
    order = np.argsort(low[:, 0], kind="stable")
    low, high = low[order], high[order]
    label = np.arange(count)
    # Of each box those that begin along x before it ends, and are not yet known to be of its group.
    ends = np.searchsorted(low[:, 0], high[:, 0], side="right")
    rows, columns, held = [label], [label], 0
    for box in range(count):
        other = np.arange(box + 1, ends[box])
        other = other[label[other] != label[box]]
        touching = (low[other] <= high[box]).all(axis=1) & (high[other] >= low[box]).all(axis=1)
        rows.append(np.full(int(touching.sum()), box))
        columns.append(other[touching])
        held += len(columns[-1])
        if held > count or box == count - 1:
            label = connected_labels(np.concatenate(rows), np.concatenate(columns), count)
            rows, columns, held = [np.arange(count)], [np.unique(label, return_index=True)[1][label]], 0
    first = np.full(count, count)
    np.minimum.at(first, label, order)
    result = np.empty(count, np.int64)
    result[order] = first[label]
    return result


def _pairs(edges: Edges) -> tuple[np.ndarray, np.ndarray]:
    """Flat indices (p,) of the two sides that meet at each edge with exactly two."""
    order = np.argsort(edges.side_edge, axis=None, kind="stable")
    begin = np.concatenate([[0], np.cumsum(edges.face_count)[:-1]])[edges.face_count == 2]
    return order[begin], order[begin + 1]


def adjacent_faces(edges: Edges) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of faces that share an edge with exactly two faces: first, second (p,), and the edge (p,)."""
    first, second = _pairs(edges)
    return first // 3, second // 3, edges.side_edge.ravel()[first]


def find_turned(edges: Edges, area: np.ndarray) -> tuple[np.ndarray, bool]:
    """Consistent orientation: the faces to turn over so that neighbours agree.

    Of the two ways round, each patch takes the one that turns less area. A patch that cannot agree with itself
    (a Moebius strip) is left as it is.

    Args:
        edges: of the mesh. area: (m,), the faces' areas.

    Returns:
        (m,) bool; whether all patches agree then.
    """
    count = len(edges.side_edge)
    turned = np.zeros(count, bool)
    first, second = _pairs(edges)
    direction = edges.side_direction.ravel()
    clash = direction[first] == direction[second]
    if not clash.any():
        return turned, True
    # A graph of two nodes a face, kept (f) and turned (f + m): neighbours that agree link like with like.
    a, b = first // 3, second // 3
    other = np.where(clash, count, 0)
    rows = np.concatenate([a, a + count])
    columns = np.concatenate([b + other, b + count - other])
    label = connected_labels(rows, columns, 2 * count)
    kept_label, turned_label = label[:count], label[count:]
    possible = kept_label != turned_label
    side = possible & (kept_label > turned_label)
    patch = np.minimum(kept_label, turned_label)
    turned_area = np.bincount(patch, area * side)
    whole_area = np.bincount(patch, area)
    turned = possible & (side ^ (2.0 * turned_area > whole_area)[patch])
    return turned, bool(possible.all())


def open_patches(edges: Edges, patch: np.ndarray) -> np.ndarray:
    """Mask of patches with an edge that their own faces do not pass both ways equally, (patches,) bool."""
    key = patch[:, None] * np.int64(edges.count) + edges.side_edge
    unique, inverse = np.unique(key, return_inverse=True)
    sums = np.bincount(inverse.ravel(), edges.side_direction.ravel())
    is_open = np.zeros(int(patch.max()) + 1, bool)
    is_open[unique[sums != 0] // edges.count] = True
    return is_open


def opposite_twin(faces: np.ndarray) -> np.ndarray:
    """For each face the index of another face with the same three corners, -1 if there is none; (m,) int."""
    rows = np.sort(faces, axis=1)
    order = np.lexsort(rows.T)
    same = (np.diff(rows[order], axis=0) == 0).all(axis=1)
    twin = np.full(len(faces), -1)
    # Equal faces were dropped, so that at most two have the same corners.
    twin[order[:-1][same]] = order[1:][same]
    twin[order[1:][same]] = order[:-1][same]
    return twin
