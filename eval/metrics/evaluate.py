"""Every metric of one reconstruction of one target, by the definitions that papers and peers use."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ...kernels.runtime.launch import choose_device
from ...shape.grid import intersection_over_union
from ...shape.target import Target, make_target
from .assembly_metrics import RESOLUTION, target_occupancy
from .features import POINT_COUNT, make_features
from .prediction import Prediction, mesh_distance
from .prediction_files import place, read_prediction
from .semantic_metrics import measure_semantics
from .surface_metrics import (
    NEAR_POINTS,
    PAIRED_POINTS,
    SIGMAS,
    bisurf_iou,
    chamfer,
    draw_surface,
    earth_movers,
    surface_distance,
)

Align = Literal["none", "bbox"]

OPEN_KINDS = ("winding", "shell", "mixed")
"""Kinds of solids whose inside was decided and not given: IoU is no headline for these."""

SEED = 0
DRAWN = (
    "target",
    "prediction",
    "paired target",
    "paired prediction",
    "second target",
    "distance",
    "features",
    *SIGMAS,
)
"""What random numbers are drawn for, each from a source of its own: leaving one out changes no other."""

FEW_SAMPLES = 1000
"""Of the samples that a fit would need; metrics draw their own."""

FACTOR = 2.0
"""Boxes whose longest sides differ by more than this were hardly meant to match."""


@dataclass(frozen=True)
class TargetSurface:
    """The surface that distances are to: that of the solid, or the mesh's own where it is open."""

    target: Target
    closed: bool
    vertices: np.ndarray
    """(n, 3) float32, normalised."""
    faces: np.ndarray
    """(m, 3) int."""
    source: Any
    """The mesh, for programs that make features of it: a path or a trimesh object."""

    @classmethod
    def of(cls, mesh: Any, device: str = "auto") -> TargetSurface:
        """The surface of a mesh: a path or a trimesh object.

        Raises:
            InputError: if it cannot be read or holds nothing solid.
        """
        target = make_target(mesh, choose_device(device), RESOLUTION, FEW_SAMPLES)
        if target.solid.kind in OPEN_KINDS:
            return cls(target, False, target.vertices, target.faces, mesh)
        return cls(target, True, target.solid.vertices, target.solid.boundary_faces, mesh)

    def draw(self, count: int, purpose: str) -> np.ndarray:
        """Points (count, 3) float32 on it, by area; equal purposes give equal points."""
        return draw_surface(self.vertices, self.faces, count, _random_source(purpose))

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Distance (n,) of points (n, 3) to it, without a sign."""
        if self.closed:
            return np.abs(self.target.query.signed_distance(points))
        from ...kernels.mesh.mesh_query import MeshQuery

        return mesh_distance(MeshQuery(self.vertices, self.faces, self.target.query.device), points)

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Point membership: True where points (n, 3) are inside the solid, (n,) bool."""
        return self.target.query.signed_distance(points) < 0.0


def evaluate(
    prediction: Any,
    target: Any,
    *,
    align: Align = "none",
    emd: bool = True,
    features: Any = None,
    device: str = "auto",
) -> dict[str, Any]:
    """Score a reconstruction.

    Args:
        prediction: an Assembly; the path of an assembly.json or of the folder that holds it; or parts made by any other
            tool: a mesh file, a trimesh mesh or scene, or a sequence of meshes. Mesh units, in the target's own frame.
        target: a mesh: a path or a trimesh object; or its `TargetSurface`, to score several predictions of it.
        align: `bbox` moves the prediction's box onto the target's, in the same proportions.
        emd: whether to compute the earth mover's distance, which takes as long as the rest.
        features: where features for IntraPrim and InterPrim come from; see `features.make_features`.
        device: `auto`, `cpu`, `cuda:0`.

    Returns:
        The metrics, by the keys of the command's JSON; what was not computed, or does not exist (distances of a
        prediction without a surface), is None. `closed`, `target_kind` and `target_rule` say what the target was taken
        for; of an open one the distances to the mesh's own surface come first. `notes` are sentences about what is
        odd. Everything is measured in the target's normalised frame: longest side 1.8.

    Raises:
        InputError: if the prediction or the target cannot be read, or features cannot be had.
    """
    source = read_prediction(prediction)
    surface = target if isinstance(target, TargetSurface) else TargetSurface.of(target, device)
    found = surface.target
    onto = None
    if align == "bbox":
        lower, upper = found.transform.to_mesh(np.stack([found.lower, found.upper]))
        onto = (lower, upper)
    placed, sentence = place(source, found.transform, device, onto)
    notes = [sentence] if sentence else []
    notes += getattr(source, "notes", ())
    mismatch = _frame_mismatch(placed, found)
    if mismatch:
        notes.append(mismatch)
    elif max(float(placed.upper.max()), -float(placed.lower.min())) > 1.0:
        notes.append(
            "The prediction reaches beyond [-1, 1], where IoU and overlap are counted; distances see it all."
        )
    row = _volume_metrics(placed, surface) | _distance_metrics(placed, surface, emd)
    row |= _semantic_metrics(placed, surface, features)
    row |= {"floats": placed.floats, "closed": surface.closed, "target_kind": found.solid.kind}
    row |= {"target_rule": " ".join([found.sentence, *found.notes]), "notes": notes}
    # Of parts that are astronomically far away, some distances are beyond all numbers.
    return {key: None if _is_endless(row[key]) else row[key] for key in _ordered_keys(surface.closed)}


def _is_endless(value: Any) -> bool:
    return isinstance(value, float) and not math.isfinite(value)


def _ordered_keys(closed: bool) -> list[str]:
    """Keys of a row in the order in which they are shown."""
    distances = ["surface_mean", "surface_p95", "surface_max"]
    shares = ["iou", "bisurf_iou", "bisurf_iou_005"]
    first = [*shares, "cd", "cd_floor", "emd"] if closed else [*distances, "cd", "cd_floor", "emd", *shares]
    parts = ["primitive_count", "overlap", "unoverlap", "intra_prim", "inter_prim", "floats"]
    rest = (distances if closed else []) + ["closed", "target_kind", "target_rule", "notes"]
    return [*first, *parts, *rest]


def _random_source(purpose: str) -> np.random.Generator:
    """Random numbers for one of DRAWN, always the same."""
    return np.random.default_rng([SEED, DRAWN.index(purpose)])


def _volume_metrics(prediction: Prediction, surface: TargetSurface) -> dict[str, Any]:
    occupancy = prediction.occupancy()
    row: dict[str, Any] = {
        "iou": intersection_over_union(target_occupancy(surface.target), occupancy.union),
        "overlap": occupancy.overlap,
        "unoverlap": occupancy.unoverlap,
        "primitive_count": prediction.primitive_count,
    }
    on_target = surface.draw(NEAR_POINTS, "target")
    on_prediction = prediction.draw(NEAR_POINTS, _random_source("prediction"))
    for key, sigma in SIGMAS.items():
        noise = _random_source(key)
        row[key] = bisurf_iou(on_target, on_prediction, sigma, surface.inside, prediction.inside, noise)
    return row


def _distance_metrics(prediction: Prediction, surface: TargetSurface, emd: bool) -> dict[str, Any]:
    a = surface.draw(PAIRED_POINTS, "paired target")
    b = prediction.draw(PAIRED_POINTS, _random_source("paired prediction"))
    row: dict[str, Any] = dict.fromkeys(("cd", "emd", "surface_mean", "surface_p95", "surface_max"))
    row["cd_floor"] = chamfer(a, surface.draw(PAIRED_POINTS, "second target"))
    if not len(b):
        return row
    row["cd"] = chamfer(a, b)
    if emd:
        row["emd"] = earth_movers(a, b)
    there = prediction.distance(surface.draw(NEAR_POINTS, "target"))
    back = surface.distance(prediction.draw(NEAR_POINTS, _random_source("distance")))
    if not (np.isfinite(there).all() and np.isfinite(back).all()):
        return row
    found = surface_distance(there, back)
    return row | {"surface_mean": found.mean, "surface_p95": found.p95, "surface_max": found.largest}


def _semantic_metrics(
    prediction: Prediction, surface: TargetSurface, features: Any
) -> dict[str, float | None]:
    row: dict[str, float | None] = {"intra_prim": None, "inter_prim": None}
    if features is None:
        return row
    frame = surface.target.transform
    wanted = frame.to_mesh(surface.draw(POINT_COUNT, "features"))
    points, vectors = make_features(features, surface.source, wanted)
    if not prediction.primitive_count:
        return row
    owners = prediction.owners(frame.to_normalised(points).astype(np.float32))
    found = measure_semantics(vectors, owners)
    return {"intra_prim": found.intra_prim, "inter_prim": found.inter_prim}


def _frame_mismatch(prediction: Prediction, target: Target) -> str:
    """A sentence if the two boxes were hardly meant to match, else an empty string."""
    if not prediction.primitive_count:
        return ""
    side = float((target.upper - target.lower).max())
    other = float((prediction.upper - prediction.lower).max())
    factor = max(side, other) / max(min(side, other), 1e-300)
    apart = bool((prediction.upper < target.lower).any() or (prediction.lower > target.upper).any())
    if factor < FACTOR and not apart:
        return ""
    what = "do not touch" if apart else f"differ in size by a factor of {factor:.3g}"
    return (
        f"The boxes of prediction and target {what}: probably different frames or units; align them by bbox"
        " (--align bbox) if that is so."
    )
