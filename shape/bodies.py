"""Sorting the faces of a mesh into closed bodies, turned outwards, and open patches.

Frame: normalised. Nothing here asks where inside is but for closed bodies; `solid` decides about the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from ..kernels.mesh.inside_points import winding_numbers
from ..kernels.mesh.mesh_query import MeshQuery
from .topology import Edges, find_edges, find_turned, is_balanced, label_patches, open_patches, opposite_twin
from .weld import face_areas

FLAT_SHARE = 1e-6
"""A closed body with less volume than this share of (its area)^1.5 is a flat sheet with two sides, no solid."""

PROBES_PER_BODY = 9
"""Faces of an inward body that are asked whether they lie inside the others."""


@dataclass(frozen=True)
class Bodies:
    """The faces of a mesh in four groups; each face is in at most one."""

    faces: np.ndarray
    """(m, 3) int, some turned over."""
    closed: np.ndarray
    """(m,) bool: faces of closed bodies, counter-clockwise seen from outside; those of cavities, from within."""
    open: np.ndarray
    """(m,) bool: faces of patches that do not close."""
    walls: np.ndarray
    """(m,) bool: what closed bodies can do without. One of each two faces back to back, which are walls between
    them or sheets beside them; and bodies so flat that they are sheets with two sides."""
    patch: np.ndarray
    """(m,) int, the body or patch of each face."""
    turned_count: int
    """Faces turned over to agree with their neighbours."""
    inverted_count: int
    """Closed bodies that were inside out."""
    body_count: int
    """Closed bodies, cavities included."""
    cavity_count: int


def sort_bodies(vertices: np.ndarray, faces: np.ndarray, device: wp.Device) -> Bodies:
    """Group the faces (m, 3) of welded vertices (n, 3), normalised, and turn closed bodies outwards."""
    twin = opposite_twin(faces)
    walls = np.zeros(len(faces), bool)
    dropped = np.zeros(len(faces), bool)
    if (twin >= 0).any():
        walls, dropped = _resolve_twins(faces, twin)
    used = np.flatnonzero(~(walls | dropped))
    edges = find_edges(faces[used])
    areas = face_areas(vertices, faces[used])
    turned, _ = find_turned(edges, areas)
    if is_balanced(edges):
        # As it is, the mesh winds a whole number of times round everything: nothing needs to be turned, even
        # where bodies meet in edges of four faces.
        turned[:] = False
    faces = faces.copy()
    faces[used[turned]] = faces[used[turned], ::-1]
    if turned.any():
        edges = find_edges(faces[used])
    is_open, patch = _group(edges)
    volumes = np.bincount(patch, _signed_volumes(vertices, faces[used]))
    flat = np.abs(volumes) <= FLAT_SHARE * np.bincount(patch, areas) ** 1.5
    flat &= ~is_open
    inverted, cavity = _find_inverted(vertices, faces[used], patch, is_open | flat, volumes, device)
    flip = used[inverted[patch]]
    faces[flip] = faces[flip, ::-1]
    closed_mask, open_mask = np.zeros(len(faces), bool), np.zeros(len(faces), bool)
    closed_mask[used], open_mask[used] = ~(is_open | flat)[patch], is_open[patch]
    walls[used] = flat[patch]
    labels = np.full(len(faces), -1)
    labels[used] = patch
    return Bodies(
        faces, closed_mask, open_mask, walls, labels, int(turned.sum()), int(inverted.sum()),
        int((~(is_open | flat)).sum()), int(cavity.sum()),
    )  # fmt: skip


def _resolve_twins(faces: np.ndarray, twin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of faces back to back: those that are walls, and those dropped; each (m,) bool.

    If what hangs together closes without both faces, they are a wall (one is kept as such) and else the skin of
    something drawn from both sides: one of them stays a face like any other.
    """
    paired = twin >= 0
    first = paired & (np.arange(len(faces)) < twin)
    group = label_patches(find_edges(faces), through_all=True)
    rest = ~paired
    closes = np.zeros(int(group.max()) + 1, bool)
    if rest.any():
        edges = find_edges(faces[rest])
        closes[np.unique(group[rest])] = True
        sums = np.bincount(edges.side_edge.ravel(), edges.side_direction.ravel(), edges.count)
        closes[group[rest][(sums[edges.side_edge] != 0).any(axis=1)]] = False
    return first & closes[group], paired & ~first


def _group(edges: Edges) -> tuple[np.ndarray, np.ndarray]:
    """Mask of the open patches, and the patch of each face; patches that close only together are one."""
    patch = label_patches(edges)
    is_open = open_patches(edges, patch)
    if not is_open.any():
        return is_open, patch
    # Walls that three bodies share cut a skin into patches: joined across all edges they may close after all.
    loose = np.flatnonzero(is_open[patch])
    part = Edges(*_renumber(edges, loose))
    group = label_patches(part, through_all=True)
    group_open = open_patches(part, group)
    joined = ~group_open[group]
    patch = patch.copy()
    patch[loose[joined]] = len(is_open) + group[joined]
    is_open = np.concatenate([is_open, group_open])
    label, patch = np.unique(patch, return_inverse=True)
    return is_open[label], patch


def _renumber(edges: Edges, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    _, side_edge, count = np.unique(edges.side_edge[chosen], return_inverse=True, return_counts=True)
    return side_edge.reshape(-1, 3), edges.side_direction[chosen], count


def _signed_volumes(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Signed volumes (m,) of the tetrahedra from the origin to each face."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0


def _find_inverted(
    vertices: np.ndarray,
    faces: np.ndarray,
    patch: np.ndarray,
    is_open: np.ndarray,
    volumes: np.ndarray,
    device: wp.Device,
) -> tuple[np.ndarray, np.ndarray]:
    """Masks of the bodies that are inside out, and of the cavities; each (patches,) bool."""
    closed = ~is_open
    inverted = np.zeros(len(is_open), bool)
    if volumes[closed].sum() < 0.0:
        # More inward than outward: as a whole it is inside out, and its cavities with it.
        inverted = closed.copy()
    inward = closed & (np.where(inverted, -volumes, volumes) < 0.0)
    if not inward.any():
        return inverted, inward
    outward = closed & ~inward
    solid = faces[outward[patch]]
    solid = np.where(inverted[patch[outward[patch]]][:, None], solid[:, ::-1], solid)
    query = MeshQuery(vertices, solid, device)
    # A few faces of each inward body, spread over it: is it inside an outward one?
    inner = np.flatnonzero(inward[patch])
    inner = inner[np.argsort(patch[inner], kind="stable")]
    _, start, count = np.unique(patch[inner], return_index=True, return_counts=True)
    picks = (start[:, None] + (np.arange(PROBES_PER_BODY) * count[:, None]) // PROBES_PER_BODY).ravel()
    points = vertices[faces[inner[picks]]].mean(axis=1)
    winding = winding_numbers(
        query, wp.array(points.astype(np.float32), dtype=wp.vec3, device=device)
    ).numpy()
    inside = np.median(winding.reshape(-1, PROBES_PER_BODY), axis=1) > 0.5
    cavity = np.zeros(len(is_open), bool)
    cavity[np.flatnonzero(inward)[inside]] = True
    return inverted ^ (inward & ~cavity), cavity
