"""The parts that a mesh is made of: nodes of its scene, else bodies, each as a target in a frame of its own.

What the solid is was decided for the whole mesh; a part is the inside of its own share of the faces. Thin parts of
a large mesh gain: their own box is filled by as many cells as the whole one is.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from ..assembly.transform import Transform
from .grid import distance_grid, grid_volume
from .samples import make_samples
from .solid import Solid
from .solid_query import SolidQuery
from .target import Target
from .topology import connected_labels, find_edges, label_patches, label_touching, open_patches
from .weld import face_areas

RANDOM_SUFFIX = re.compile(r"_(?=[0-9a-f]{6}$)")
"""What trimesh appends to the name of a node for each of its materials, in its scenes and in files that it writes."""


@dataclass(frozen=True)
class Piece:
    """One part of a mesh, in the normalised frame of the whole."""

    name: str
    """Of its node; `body_01`, `body_02`, ... by size where there are no nodes."""
    vertices: np.ndarray
    """(n, 3) float32; each is used by a face."""
    winding_faces: np.ndarray
    """(m, 3) int32, outwards, holes closed; what they wind round is the part."""
    sheet_faces: np.ndarray
    """(s, 3) int32, faces that enclose nothing and have the whole's thickness."""
    share: float
    """Of the whole's visible surface and volume, their mean, about 0..1."""


def split_target(target: Target) -> list[Piece]:
    """The parts of a target, in the order of its nodes or from large to small; parts that nobody sees are left out.

    Nodes that share an edge or a name are one part: a mesh of several materials is read as several nodes. If only one
    is left, bodies are the parts. A cavity belongs to the body around it, and patches that enclose something only
    together stay together.
    """
    edges = find_edges(target.faces)
    body = label_patches(edges, through_all=True)
    names = _names_of_nodes([part.name for part in target.parts])
    node = _node_of_faces(target, names)
    label = _join_nodes(body, node)
    by_node = label.max() > 0
    if not by_node:
        label = body
    winding, sheets = _faces_by_label(target, label)
    if not by_node:
        label_of = _join_bodies(target, winding, int(label.max()) + 1)
        winding, sheets = label_of[winding], label_of[sheets]
    pieces = _cut(target, winding, sheets)
    if by_node:
        most = _most_frequent(label, node)
        taken: dict[str, int] = {}
        return [replace(piece, name=_unique_name(names[most[part]], taken)) for part, piece in pieces]
    ordered = sorted(pieces, key=lambda entry: -entry[1].share)
    return [replace(piece, name=f"body_{rank:02d}") for rank, (_, piece) in enumerate(ordered, 1)]


def piece_target(
    piece: Piece, whole: Target, device: wp.Device, resolution: int, sample_count: int, seed: int
) -> Target:
    """A part as a target of its own.

    Args:
        piece: from `split_target` of `whole`.
        whole: the target that it is a part of.
        device, resolution, sample_count, seed: as in `make_target`.

    Returns:
        Its `transform` takes the part's normalised frame to that of the whole, not to mesh units.
    """
    solid = replace(
        whole.solid,
        vertices=piece.vertices,
        winding_faces=piece.winding_faces,
        boundary_faces=piece.winding_faces,
        boundary_source=np.arange(len(piece.winding_faces)),
        sheet_faces=piece.sheet_faces,
        thickness=whole.solid.thickness if len(piece.sheet_faces) else 0.0,
    )
    faces = np.concatenate([piece.winding_faces, piece.sheet_faces])
    return solid_target(solid, piece.vertices, faces, whole, device, resolution, sample_count, seed)


def solid_target(
    solid: Solid,
    vertices: np.ndarray,
    faces: np.ndarray,
    whole: Target,
    device: wp.Device,
    resolution: int,
    sample_count: int,
    seed: int,
) -> Target:
    """A decided solid as a target in a frame of its own.

    Args:
        solid: in some frame.
        vertices, faces: (n, 3) and (m, 3) of the mesh, in that frame.
        whole: the target that it comes from.
        device, resolution, sample_count, seed: as in `make_target`.

    Returns:
        Its `transform` takes its normalised frame to that of the solid given, not to mesh units.
    """
    half = 0.5 * solid.thickness
    low, high = vertices.min(axis=0) - half, vertices.max(axis=0) + half
    transform = Transform.from_bounds(low, high)
    solid = replace(
        solid,
        vertices=transform.to_normalised(solid.vertices).astype(np.float32),
        thickness=solid.thickness / transform.scale,
    )
    query = SolidQuery(solid, device)
    grid = distance_grid(query, resolution)
    lower, upper = transform.to_normalised(np.stack([low, high]))
    return replace(
        whole,
        transform=transform,
        vertices=transform.to_normalised(vertices).astype(np.float32),
        faces=faces,
        parts=(),
        solid=solid,
        query=query,
        grid=grid,
        resolution=resolution,
        samples=make_samples(query, lower, upper, sample_count, seed),
        lower=lower,
        upper=upper,
        volume=grid_volume(grid),
    )


def _names_of_nodes(names: list[str]) -> list[str]:
    """Names without the random suffixes that tell the materials of one node apart.

    A suffix of digits only is a number that somebody gave, unless another one of the same stem has letters.
    """
    split = [RANDOM_SUFFIX.split(name) for name in names]
    random = {parts[0] for parts in split if len(parts) == 2 and not parts[1].isdigit()}
    return [parts[0] if parts[0] in random else name for name, parts in zip(names, split, strict=True)]


def _node_of_faces(target: Target, names: list[str]) -> np.ndarray:
    """The index of the first node of that name that each face came from, (m,) int."""
    node = np.zeros(len(target.faces), np.int64)
    first: dict[str, int] = {}
    for index, (part, name) in enumerate(zip(target.parts, names, strict=True)):
        node[part.first_face : part.first_face + part.face_count] = first.setdefault(name, index)
    return node


def _join_nodes(body: np.ndarray, node: np.ndarray) -> np.ndarray:
    """Number of the part of each face (m,): nodes that share a body are one. In the order of the nodes."""
    size = int(node.max()) + 1
    label = connected_labels(node, body + size, size + int(body.max()) + 1)[node]
    _, first, inverse = np.unique(label, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    return rank[inverse]


def _most_frequent(label: np.ndarray, node: np.ndarray) -> np.ndarray:
    """The node that most faces of each label have, (labels,) int: the first one of equally many."""
    pairs, count = np.unique(label * (node.max() + 1) + node, return_counts=True)
    of_label, of_node = np.divmod(pairs, node.max() + 1)
    order = np.lexsort((of_node, -count, of_label))
    return of_node[order[np.searchsorted(of_label, np.arange(label.max() + 1))]]


def _faces_by_label(target: Target, label: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Label of each winding face and of each sheet face of the solid, from those of the mesh's faces (m,)."""
    count = np.int64(len(target.solid.vertices) + 1)

    def key(faces: np.ndarray) -> np.ndarray:
        a, b, c = np.sort(faces.astype(np.int64), axis=1).T
        return (a * count + b) * count + c

    known = key(target.faces)
    order = np.argsort(known, kind="stable")
    of_vertex = np.zeros(int(count), np.int64)
    of_vertex[target.faces.ravel()] = np.repeat(label, 3)

    def look(faces: np.ndarray) -> np.ndarray:
        place = np.minimum(np.searchsorted(known[order], key(faces)), len(order) - 1)
        found = order[place]
        # The fans that close holes are no faces of the mesh: they begin at two corners of their rim.
        return np.where(known[found] == key(faces), label[found], of_vertex[faces[:, 0]])

    return look(target.solid.winding_faces), look(target.solid.sheet_faces)


def _join_bodies(target: Target, winding: np.ndarray, count: int) -> np.ndarray:
    """New label (count,) of each body: cavities join what is around them, leaking patches one another."""
    solid = target.solid
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    corners = solid.vertices[solid.winding_faces].astype(np.float64)
    np.minimum.at(low, winding, corners.min(axis=1))
    np.maximum.at(high, winding, corners.max(axis=1))
    origin = corners.mean(axis=(0, 1)) if len(corners) else np.zeros(3)
    a, b, c = (corners[:, k] - origin for k in range(3))
    volume = np.bincount(winding, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0, count)
    leaks = np.zeros(count, bool)
    if len(winding):
        # Those with rims that no cap closes.
        open_bodies = open_patches(find_edges(solid.winding_faces), winding)
        leaks[: len(open_bodies)] = open_bodies
    loose, label = np.flatnonzero(leaks), np.arange(count)
    label[loose] = loose[label_touching(low[loose], high[loose])]
    cavities, outer = np.flatnonzero((volume < 0.0) & ~leaks), np.flatnonzero(volume > 0.0)
    size = (high[outer] - low[outer]).prod(axis=1)
    holders = cavities.copy()
    for index, body in enumerate(cavities):
        around = (low[outer] <= low[body]).all(axis=1) & (high[outer] >= high[body]).all(axis=1)
        if around.any():
            holders[index] = outer[np.where(around, size, np.inf).argmin()]
    rows, columns = np.append(np.arange(count), cavities), np.append(label, holders)
    return connected_labels(rows, columns, count)


def _cut(target: Target, winding: np.ndarray, sheets: np.ndarray) -> list[tuple[int, Piece]]:
    """(label, part without a name) of everything that is seen, by label."""
    solid = target.solid
    vertices = solid.vertices.astype(np.float64)
    count = int(max(winding.max(initial=-1), sheets.max(initial=-1))) + 1
    source = solid.boundary_source if len(solid.boundary_source) else np.arange(len(winding))

    def summed(labels: np.ndarray, weights: np.ndarray) -> np.ndarray:
        return np.bincount(labels, weights, count).astype(np.float64)

    seen = summed(winding[source], face_areas(vertices, solid.boundary_faces))
    sheet_area = 2.0 * summed(sheets, face_areas(vertices, solid.sheet_faces))
    corners = vertices[solid.winding_faces]
    a, b, c = (corners[:, k] for k in range(3))
    volume = np.abs(summed(winding, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0))
    volume += 0.5 * sheet_area * solid.thickness
    area = seen + sheet_area
    shares = 0.5 * (area / area.sum() + volume / max(volume.sum(), 1e-300))
    pieces = []
    labels = np.concatenate([winding, sheets])
    order = np.argsort(labels, kind="stable")
    starts = np.searchsorted(labels[order], np.arange(count + 1))
    splits = starts[:-1] + np.bincount(winding, minlength=count)
    faces = np.concatenate([solid.winding_faces, solid.sheet_faces])[order].astype(np.int64)
    used, inverse = np.unique(labels[order, None] * len(vertices) + faces, return_inverse=True)
    bounds = np.searchsorted(used, np.arange(count + 1) * len(vertices))
    faces = (inverse.reshape(-1, 3) - bounds[labels[order], None]).astype(np.int32)
    used = solid.vertices[used % len(vertices)]
    for label in np.flatnonzero(area > 1e-4 * area.sum() / max(count, 1)):
        low, split, high = starts[label], splits[label], starts[label + 1]
        own = used[bounds[label] : bounds[label + 1]]
        piece = Piece("", own, faces[low:split], faces[split:high], float(shares[label]))
        pieces.append((int(label), piece))
    return pieces


def _unique_name(node: str, taken: dict[str, int]) -> str:
    """The node's name as a part may bear it, with a number where it is taken: printable, at most 100 letters."""
    name = re.sub(r"[^\w.\- ]+", "_", node).strip()[:100] or "part"
    taken[name] = taken.get(name, 0) + 1
    return name if taken[name] == 1 else f"{name}_{taken[name]}"
