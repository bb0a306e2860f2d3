"""Topology of dual contouring: the edges of a grid cell that belong to one sheet of the surface.

A cell has 8 corners (bit 0 of a number is x, bit 1 y, bit 2 z) and 12 edges (4 * axis + position). On each of its 6
faces (2 * axis + side) the crossed edges pair up; following the pairs round the cell gives closed loops, the patches,
and each patch gets a vertex of its own. A face whose corners alternate can be paired in two ways: a bit per face says
which, the same for both cells that share it, so that the surface closes whatever is chosen.
"""

from __future__ import annotations

from functools import cache

import numpy as np

EDGES = 12
FACES = 6


def edge(axis: int, first: int, second: int) -> int:
    """Number of the edge along `axis` at the offsets 0 or 1 along the next axis and the one after it."""
    return 4 * axis + first + 2 * second


def _edge_offsets(number: int) -> np.ndarray:
    """Offset (3,) of the lower end of an edge from the cell's lower corner."""
    axis, position = divmod(number, 4)
    offset = np.zeros(3, np.int64)
    offset[(axis + 1) % 3] = position % 2
    offset[(axis + 2) % 3] = position // 2
    return offset


def _corner(offset: np.ndarray) -> int:
    return int(offset[0] + 2 * offset[1] + 4 * offset[2])


def _face_corners(face: int) -> list[int]:
    """Corners of a face at the offsets 00, 10, 11, 01 along the next axis and the one after it."""
    axis, side = divmod(face, 2)
    corners = []
    for first, second in ((0, 0), (1, 0), (1, 1), (0, 1)):
        offset = np.zeros(3, np.int64)
        offset[axis], offset[(axis + 1) % 3], offset[(axis + 2) % 3] = side, first, second
        corners.append(_corner(offset))
    return corners


def _face_edges(face: int) -> list[int]:
    """Edges of a face that join its corners in the order of `_face_corners`."""
    axis, side = divmod(face, 2)
    one, two = (axis + 1) % 3, (axis + 2) % 3
    # The edge along `one` has offsets along `two` and `axis`, in that order; the one along `two` along `axis`, `one`.
    return [edge(one, 0, side), edge(two, side, 1), edge(one, 1, side), edge(two, side, 0)]


FACE_CORNERS = [_face_corners(face) for face in range(FACES)]
FACE_EDGES = [_face_edges(face) for face in range(FACES)]
EDGE_ENDS = [(_corner(_edge_offsets(e)), _corner(_edge_offsets(e)) | (1 << (e // 4))) for e in range(EDGES)]


@cache
def ambiguous_faces(inside: int) -> int:
    """Bits of the faces whose corners alternate, for the corners inside the surface given as bits."""
    bits = 0
    for face, corners in enumerate(FACE_CORNERS):
        a, b, c, d = (inside >> corner & 1 for corner in corners)
        bits |= int(a == c and b == d and a != b) << face
    return bits


def face_links(face: int, inside: int, joined: bool) -> list[tuple[int, int]]:
    """Pairs of crossed edges on a face. Where it is ambiguous, `joined` connects its two inside corners."""
    edges = FACE_EDGES[face]
    crossed = [e for e in edges if (inside >> EDGE_ENDS[e][0] ^ inside >> EDGE_ENDS[e][1]) & 1]
    if len(crossed) < 4:
        return [(crossed[0], crossed[1])] if crossed else []
    # A pair cuts off one corner: the inside ones where they are separate, else the outside ones. Edges k - 1 and k
    # meet at corner k.
    first_inside = bool(inside >> FACE_CORNERS[face][0] & 1)
    cut = 0 if first_inside != joined else 1
    return [(edges[cut - 1], edges[cut]), (edges[cut + 1], edges[(cut + 2) % 4])]


@cache
def cell_patches(inside: int, joined: int) -> tuple[tuple[int, ...], int, int]:
    """Patches of a cell.

    Args:
        inside: bits of the corners inside the surface.
        joined: bits of the ambiguous faces whose inside corners are connected.

    Returns:
        Patch of each edge (EDGES,), -1 where it is not crossed; number of patches; bits of the ambiguous faces that
        one patch meets twice. Where both cells of a face do so, four triangles would share an edge.
    """
    links = [face_links(face, inside, bool(joined >> face & 1)) for face in range(FACES)]
    patch = list(range(EDGES))
    for a, b in (pair for pairs in links for pair in pairs):
        low, high = sorted((patch[a], patch[b]))
        patch = [low if label == high else label for label in patch]
    crossed = [(inside >> a ^ inside >> b) & 1 for a, b in EDGE_ENDS]
    labels = sorted({label for label, there in zip(patch, crossed, strict=True) if there})
    edges = tuple(labels.index(label) if there else -1 for label, there in zip(patch, crossed, strict=True))
    twice = 0
    for face, pairs in enumerate(links):
        if len(pairs) == 2 and edges[pairs[0][0]] == edges[pairs[1][0]]:
            twice |= 1 << face
    return edges, len(labels), twice
