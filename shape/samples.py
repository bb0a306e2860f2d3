"""Points on, near and around a solid, with exact signed distances from its faces, never from a grid.

Frame: normalised. Everything follows from the seed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .curvature import Curvature, measure_curvature, weight_of
from .solid_query import Located, SolidQuery
from .topology import find_edges, label_patches
from .weld import face_areas

NOISE = 0.02
"""Standard deviation of the near points' distance from the surface, per axis."""

TIGHT_NOISE = 0.005
"""The same for the tighter layer, which sees walls that the wider one jumps over."""

TIGHT_SHARE = 0.25
"""Share of the near points in the tighter layer."""

POINTS_PER_BODY = 12
"""Surface points that even the smallest body gets."""

BODY_SHARE = 0.25
"""Most of the surface points that go to bodies because they are small and not by their area."""

PLASTIC_2, PLASTIC_3 = 1.3247179572447460, 1.2207440846057596
"""Roots of x^3 = x + 1 and x^4 = x + 1: steps by their powers fill the square and the cube evenly (R2, R3)."""


@dataclass(frozen=True)
class SurfacePoints:
    """Points on the surface of a solid."""

    points: np.ndarray
    """(n, 3) float32."""
    normals: np.ndarray
    """(n, 3) float32, unit length, outwards."""
    weight: np.ndarray
    """(n,) float32, 1.5 where flat to 2 at creases."""


@dataclass(frozen=True)
class NearPoints:
    """Points near the surface of a solid."""

    points: np.ndarray
    """(n, 3) float32."""
    distance: np.ndarray
    """(n,) float32, signed, negative inside."""
    weight: np.ndarray
    """(n,) float32, that of the nearest surface point."""


@dataclass(frozen=True)
class VolumePoints:
    """Points spread evenly over the bounding box of a solid."""

    points: np.ndarray
    """(n, 3) float32."""
    distance: np.ndarray
    """(n,) float32, signed, negative inside."""


@dataclass(frozen=True)
class Samples:
    """Sample points that the fitter looks at."""

    surface: SurfacePoints
    near: NearPoints
    volume: VolumePoints


def make_samples(query: SolidQuery, lower: np.ndarray, upper: np.ndarray, count: int, seed: int) -> Samples:
    """`count` near and volume points, and about as many on the surface.

    Args:
        query: the solid; points get cheaper once its grid is made.
        lower, upper: corners (3,) of the box that the volume points fill.
        count: points of each kind, at least 1.
        seed: equal seeds give equal points.
    """
    rng = np.random.default_rng(seed)
    skin = Skin(query)
    surface = skin.sample(count, rng)
    near = skin.sample_near(surface.points, count, rng)
    shift = rng.random(3)
    steps = np.arange(1, count + 1)[:, None] * PLASTIC_3 ** -np.arange(1.0, 4.0)
    points = (lower + (upper - lower) * ((shift + steps) % 1.0)).astype(np.float32)
    return Samples(surface, near, VolumePoints(points, query.signed_distance(points)))


@dataclass(frozen=True)
class Layer:
    """One side of some faces."""

    faces: np.ndarray
    """(m, 3) int."""
    body: np.ndarray
    """(m,) int from 0, the body of each face."""
    offset: float
    """Distance from the faces, along their normals, at which the surface is; 0 but for the sides of sheets."""
    bend: Curvature


class Skin:
    """The surface of a solid, ready to be sampled: the boundary's faces, and both sides of its sheets."""

    def __init__(self, query: SolidQuery) -> None:
        """Measure areas and curvature."""
        solid = query.solid
        self.query = query
        self.layers: list[Layer] = []
        if len(solid.boundary_faces):
            # Measured on the whole faces: pieces of them no longer meet side by side.
            bend = measure_curvature(solid.vertices, solid.winding_faces)
            bend = Curvature(bend.face[solid.boundary_source], bend.creases)
            body = label_patches(find_edges(solid.winding_faces))[solid.boundary_source]
            self.layers.append(Layer(solid.boundary_faces, body, 0.0, bend))
        if len(solid.sheet_faces):
            bend = measure_curvature(solid.vertices, solid.sheet_faces)
            body = label_patches(find_edges(solid.sheet_faces))
            for side in (0.5, -0.5):
                self.layers.append(Layer(solid.sheet_faces, body, side * solid.thickness, bend))

    def sample(self, count: int, rng: np.random.Generator) -> SurfacePoints:
        """About `count` points on the surface, by area, and a few on each small body."""
        vertices = self.query.solid.vertices.astype(np.float64)
        areas = [face_areas(vertices, layer.faces) for layer in self.layers]
        total = sum(float(area.sum()) for area in areas)
        points, normals, weights = [], [], []
        for layer, area in zip(self.layers, areas, strict=True):
            wanted = round(count * float(area.sum()) / total) if total > 0.0 else 0
            chosen, share = _stratify(layer.body, area, max(wanted, 1), rng)
            a, b, c = (vertices[layer.faces[chosen, k]] for k in range(3))
            cross = np.cross(b - a, c - a)
            normal = cross / np.maximum(np.linalg.norm(cross, axis=1), 1e-300)[:, None]
            point = a * share[:, :1] + b * share[:, 1:2] + c * share[:, 2:]
            points.append(point + layer.offset * normal)
            normals.append(normal if layer.offset >= 0.0 else -normal)
            weights.append(weight_of(layer.bend.at(point, chosen)))
        surface = SurfacePoints(
            np.concatenate(points).astype(np.float32), np.concatenate(normals).astype(np.float32),
            np.concatenate(weights),
        )  # fmt: skip
        return self._on_surface(surface) if len(self.layers) > 1 else surface

    def _on_surface(self, surface: SurfacePoints) -> SurfacePoints:
        """Without the points of one layer that lie inside another."""
        depth = self.query.signed_distance(surface.points)
        kept = depth > -1e-4
        if not kept.any():
            return surface
        return SurfacePoints(surface.points[kept], surface.normals[kept], surface.weight[kept])

    def sample_near(self, base: np.ndarray, count: int, rng: np.random.Generator) -> NearPoints:
        """`count` points: surface points `base` (k, 3), moved by Gaussian noise."""
        order = np.arange(count) * len(base) // count
        noise = np.where(rng.permutation(count) < round(TIGHT_SHARE * count), TIGHT_NOISE, NOISE)
        points = base[order] + (rng.standard_normal((count, 3)) * noise[:, None]).astype(np.float32)
        located = self.query.locate(points)
        return NearPoints(points, located.distance, self.weight_at(located))

    def weight_at(self, located: Located) -> np.ndarray:
        """Weight (n,) float32 of the surface nearest to located points."""
        weight = np.empty(len(located.face), np.float32)
        for layer in self.layers:
            if layer.offset < 0.0:
                continue
            chosen = located.on_sheet == (layer.offset > 0.0)
            weight[chosen] = weight_of(layer.bend.at(located.nearest[chosen], located.face[chosen]))
        return weight


def _stratify(
    body: np.ndarray, area: np.ndarray, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """About `count` faces, each as often as its area asks for, and barycentric coordinates in them.

    One random number would do: along the faces laid end to end the points are equally far apart, in each they
    follow a sequence that fills a triangle evenly. Bodies that so get fewer than POINTS_PER_BODY get that many.
    """
    body_area = np.bincount(body, area)
    floor = min(POINTS_PER_BODY, int(BODY_SHARE * count / len(body_area)))
    expected = body_area * (count / max(float(body_area.sum()), 1e-300))
    boost = np.where(body_area > 0.0, np.maximum(1.0, floor / np.maximum(expected, 1e-300)), 0.0)
    weight = area * boost[body]
    total = round(float(weight.sum() / max(float(area.sum()), 1e-300)) * count)
    # Bodies one after another, so that each gets its number and not by chance one less.
    order = np.argsort(body, kind="stable")
    edges = np.cumsum(weight[order])
    place = (np.arange(total) + rng.random()) / total * edges[-1]
    chosen = order[np.minimum(np.searchsorted(edges, place, side="right"), len(order) - 1)]
    # Faces are in no order in which one step of the sequence is far from the next in space: shuffle the steps.
    steps = rng.permutation(total)[:, None] * PLASTIC_2 ** -np.arange(1.0, 3.0) + rng.random(2)
    u, v = (steps % 1.0).T
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)
    return chosen, np.stack([1.0 - u - v, u, v], axis=1)
