"""Deciding what the solid of a mesh is, and saying it in one sentence.

Closed bodies are solid, turned outwards if need be. An open patch is solid if the mesh winds clearly round the
points behind it and not round those before it, or if a flood from outside does not get behind it; its holes are
closed. Whatever encloses nothing becomes a thin shell. Everything is in the normalised frame (bounding box
centred, longest side 1.8) unless a name says otherwise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import warp as wp

from .bodies import Bodies, sort_bodies
from .hole_filling import cap_holes
from .outer_surface import find_boundary
from .patches import BOUNDARY, INVERTED, PROBE_OFFSET, SHEET, judge_by_flood, judge_by_winding
from .solid_query import Solid, SolidQuery, WindingQuery
from .summary import Findings, name_kind, write_sentence
from .weld import face_areas

SHEET_THICKNESS = 0.018
"""Thickness given to sheets: 1 % of the longest side, a little more than a cell of a 128^3 grid."""

DECAL_SHARE = 0.5
"""Sheets nowhere further above a solid than this share of their thickness are drawn on it, and left out."""

NARROW = 1.8 * PROBE_OFFSET
"""Area under which a mesh without closed bodies, of longest side 1.8, is a strip: no wider than its probes are away."""

MAX_JUDGEMENTS = 4
"""Rounds of judging patches: each verdict changes what winds round the others."""


def decide_solid(vertices: np.ndarray, faces: np.ndarray, scale: float, device: wp.Device) -> SolidQuery:
    """Classification of a welded mesh's solid, ready for queries.

    Args:
        vertices: (n, 3) float64, normalised. faces: (m, 3) int, m > 0.
        scale: mesh units per normalised unit, for the sentence.
        device: where to compute.
    """
    bodies = sort_bodies(vertices, faces, device)
    verdict, flooded, turned = _judge_patches(vertices, bodies, device)
    faces = np.where(turned[:, None], bodies.faces[:, ::-1], bodies.faces)
    winds = bodies.closed | (bodies.open & (verdict == BOUNDARY))
    sheets = faces[bodies.walls | (bodies.open & (verdict == SHEET))]
    body_count = len(np.unique(bodies.patch[winds]))
    winding, owner, closed_holes, open_holes = faces[winds], bodies.patch[winds], 0, 0
    if (winds & bodies.open).any():
        vertices, fans, capped, open_holes = cap_holes(vertices, winding, owner, device)
        winding, owner = np.concatenate([winding, fans]), np.concatenate([owner, capped])
        closed_holes = len(np.unique(fans[:, 2]))
    boundary, source, query = winding, np.zeros(0, np.int64), None
    if len(winding):
        query = WindingQuery(vertices, winding, device)
        vertices, boundary, source = find_boundary(vertices, winding, owner, query)
    final = winding.astype(np.int32)
    solid = Solid(
        "", "", vertices.astype(np.float32), final,
        final if boundary is winding else boundary.astype(np.int32), source, np.zeros((0, 3), np.int32), 0.0,
    )  # fmt: skip
    seen = _drop_decals(SolidQuery(solid, device, query), sheets.astype(np.int32))
    thickness = SHEET_THICKNESS if len(seen) else 0.0
    findings = Findings(
        bodies=body_count,
        open_bodies=len(np.unique(bodies.patch[winds & bodies.open])),
        cavities=bodies.cavity_count,
        turned_faces=bodies.turned_count,
        inverted_bodies=bodies.inverted_count,
        overlaps=boundary is not winding,
        flooded_bodies=len(np.unique(bodies.patch[flooded & (verdict == BOUNDARY)])),
        closed_holes=closed_holes,
        open_holes=open_holes,
        dropped_faces=len(sheets) - len(seen),
        sheet_faces=len(seen),
        thickness=thickness * scale,
    )
    solid = replace(
        solid,
        kind=name_kind(findings),
        sentence=write_sentence(findings),
        sheet_faces=seen,
        thickness=thickness,
    )
    return SolidQuery(solid, device, query)


def _judge_patches(
    vertices: np.ndarray, bodies: Bodies, device: wp.Device
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For each face: its patch's verdict, whether the flood decided it, whether it is to be turned over; (m,) each.

    Verdicts are BOUNDARY for closed bodies; SHEET for walls, about which nothing is asked.
    """
    face_count = len(bodies.faces)
    flooded, turned = np.zeros(face_count, bool), np.zeros(face_count, bool)
    verdict = np.where(bodies.walls, SHEET, BOUNDARY)
    if not bodies.open.any():
        return verdict, flooded, turned
    if not bodies.closed.any() and face_areas(vertices, bodies.faces).sum() < NARROW:
        # Every probe would be beside it, where nothing winds.
        return np.full(face_count, SHEET), flooded, turned

    def judge(judged: np.ndarray, among: np.ndarray, judge_by) -> np.ndarray:
        faces = np.where(turned[:, None], bodies.faces[:, ::-1], bodies.faces)[among]
        found = judge_by(vertices, faces, bodies.patch[among], judged[among], device)
        result = np.full(face_count, BOUNDARY)
        result[judged] = found[bodies.patch[judged]]
        return result

    for _ in range(MAX_JUDGEMENTS):
        candidates = bodies.open & (verdict == BOUNDARY)
        if not candidates.any():
            break
        found = judge(candidates, bodies.closed | candidates, judge_by_winding)
        turned ^= found == INVERTED
        verdict[found == SHEET] = SHEET
        if (found == BOUNDARY).all():
            break
    unclear = bodies.open & (verdict == SHEET)
    if not unclear.any():
        return verdict, flooded, turned
    found = judge(unclear, bodies.closed | bodies.open, judge_by_flood)
    turned ^= found == INVERTED
    flooded = unclear & ((found == BOUNDARY) | (found == INVERTED))
    if flooded.any():
        verdict[flooded] = BOUNDARY
        verdict[flooded & ~_winds(vertices, bodies, verdict == BOUNDARY, turned, flooded, device)] = SHEET
    return verdict, flooded, turned


def _winds(
    vertices: np.ndarray,
    bodies: Bodies,
    bounding: np.ndarray,
    turned: np.ndarray,
    judged: np.ndarray,
    device: wp.Device,
) -> np.ndarray:
    """Mask of faces `judged` (m,) behind which `bounding` (m,), holes closed, wind clearly; (m,) bool.

    Without that, nothing would be inside behind a patch, however dry the flood left it.
    """
    faces = np.where(turned[:, None], bodies.faces[:, ::-1], bodies.faces)[bounding]
    capped, fans, owner, _ = cap_holes(vertices, faces, bodies.patch[bounding], device)
    found = judge_by_winding(
        capped,
        np.concatenate([faces, fans]),
        np.concatenate([bodies.patch[bounding], owner]),
        np.concatenate([judged[bounding], np.zeros(len(fans), bool)]),
        device,
    )
    result = np.zeros(len(judged), bool)
    result[judged] = found[bodies.patch[judged]] == BOUNDARY
    return result


def _drop_decals(query: SolidQuery, sheets: np.ndarray) -> np.ndarray:
    """Those of the sheets' faces (s, 3) that are not within the solid or drawn on its surface."""
    if not len(sheets) or query.winding is None:
        return sheets
    limit = DECAL_SHARE * SHEET_THICKNESS
    corners = query.solid.vertices[sheets]
    middles = corners.mean(axis=1)
    kept = query.signed_distance(middles) > limit
    low = np.flatnonzero(~kept)
    # Corners are drawn in a little: they often touch what the sheet is fixed to.
    drawn = corners[low] + 0.1 * (middles[low, None] - corners[low])
    height = query.signed_distance(drawn.reshape(-1, 3)).reshape(-1, 3)
    kept[low] = (height > limit).any(axis=1)
    return sheets[kept]
