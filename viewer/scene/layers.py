"""Overlays of the parts: the input mesh, its error, what is left over, samples, sections, names.

Each layer says what it depends on; it is drawn anew only when that changes. Slow ones wait until nothing is dragged.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...kernels.field.bounds import assembly_bounds
from ..model.view_options import View
from .arrangement import Arrangement, Placed
from .plotter import INK, Plotter, to_poly
from .section import PlanePicture, cut_face, distance_bands

MISSING, EXCESS = "#d1495b", "#3b6ea8"
"""Colours of what the assembly lacks and of what it has too much."""

GHOST = "#5b6b7f"
MAX_LABELS = 200
ERROR_TITLE = "distance to the assembly [mesh units]"
PERCENTILE = 98.0
"""Of the errors: where the colours of the map end."""


@dataclass(frozen=True)
class Layer:
    """One kind of thing."""

    wanted: Callable[[View], bool]
    key: Callable[[Placed, Arrangement, View], Any]
    """What the picture depends on, beside the place of its assembly."""
    draw: Callable[[Plotter, Placed, Arrangement, View], list[Any]]
    """Makes the actors of one assembly."""
    slow: bool = False
    is_cut: bool = False
    """Whether sections cut it."""


class Layers:
    """All layers of all assemblies."""

    def __init__(self, plotter: Plotter) -> None:
        """Draw into a plotter."""
        self.plotter = plotter
        self.drawn: dict[tuple[str, int], tuple[Any, list[Any]]] = {}

    def sync(self, arrangement: Arrangement, view: View, live: bool) -> None:
        """Draw what is wanted, and take away what no longer is."""
        for name, layer in LAYERS.items():
            for placed in arrangement.placed:
                self._sync(name, layer, placed, arrangement, view, live)

    def cut_with(self, item: int) -> list[Any]:
        """Actors of one assembly that sections cut."""
        return [
            actor
            for (name, owner), (_, actors) in self.drawn.items()
            if owner == item and LAYERS[name].is_cut
            for actor in actors
        ]

    def _sync(
        self, name: str, layer: Layer, placed: Placed, arrangement: Arrangement, view: View, live: bool
    ) -> None:
        at, wanted = (name, placed.item), layer.wanted(view)
        key = (placed.matrix.tobytes(), layer.key(placed, arrangement, view)) if wanted else None
        old = self.drawn.get(at)
        if (old[0] if old else None) == key or (live and layer.slow and wanted):
            return
        if old:
            for actor in old[1]:
                self.plotter.remove_actor(actor, render=False)
            if name == "error":
                self._remove_bar(at)
            del self.drawn[at]
        if wanted:
            self.drawn[at] = key, layer.draw(self.plotter, placed, arrangement, view)

    def _remove_bar(self, at: tuple[str, int]) -> None:
        others = any(name == at[0] and (name, item) != at for name, item in self.drawn)
        if not others and ERROR_TITLE in self.plotter.scalar_bars:
            self.plotter.remove_scalar_bar(ERROR_TITLE, render=False)


def _add(plotter: Plotter, mesh: Any, matrix: np.ndarray, **options: Any) -> Any:
    actor = plotter.add_mesh(mesh, reset_camera=False, render=False, pickable=False, **options)
    actor.user_matrix = matrix
    return actor


def _draw_mesh(plotter: Plotter, placed: Placed, _: Arrangement, view: View) -> list[Any]:
    if placed.comparison is None or not placed.shows_mesh:
        return []
    poly = to_poly(placed.comparison.surface)
    if view.mesh == "outline":
        actor = plotter.add_silhouette(
            poly.transform(placed.mesh_matrix, inplace=False), color=INK, line_width=2.0, feature_angle=40.0
        )
        actor.SetPickable(False)
        return [actor]
    if view.mesh == "ghost":
        return [_add(plotter, poly, placed.mesh_matrix, color=GHOST, opacity=0.22, specular=0.0)]
    return [_add(plotter, poly, placed.mesh_matrix, color="#c9ccd1", ambient=0.24, diffuse=0.86)]


def _draw_error(plotter: Plotter, placed: Placed, _: Arrangement, __: View) -> list[Any]:
    if placed.comparison is None or not placed.whole.primitives:
        return []
    vertices, faces = placed.comparison.fine_surface
    distances = placed.comparison.distances(placed.whole, vertices)
    limit = max(float(np.percentile(np.abs(distances), PERCENTILE)), 1e-12)
    poly = to_poly((vertices, faces), distance=distances)
    actor = _add(
        plotter, poly, placed.mesh_matrix, scalars="distance", cmap="RdBu_r", clim=(-limit, limit), ambient=0.45,
        diffuse=0.6, show_scalar_bar=False,
    )  # fmt: skip
    if ERROR_TITLE not in plotter.scalar_bars:
        plotter.add_scalar_bar(
            ERROR_TITLE, mapper=actor.mapper, n_labels=5, fmt="%.3g", color=INK, title_font_size=15,
            label_font_size=13, width=0.42, height=0.07, position_x=0.03, position_y=0.03, render=False,
        )  # fmt: skip
    return [actor]


def _draw_residual(plotter: Plotter, placed: Placed, _: Arrangement, __: View) -> list[Any]:
    if placed.comparison is None:
        return []
    return [
        _add(plotter, to_poly(surface), placed.mesh_matrix, color=color, ambient=0.35, specular=0.0)
        for surface, color in zip(placed.comparison.residual(placed.whole), (MISSING, EXCESS), strict=True)
        if len(surface[1])
    ]


def _draw_samples(plotter: Plotter, placed: Placed, _: Arrangement, __: View) -> list[Any]:
    if placed.comparison is None or not placed.whole.primitives:
        return []
    import pyvista as pv

    points = placed.comparison.target.samples.surface.points
    distances = placed.comparison.distances(placed.whole, points)
    cloud = pv.PolyData(points.astype(np.float32))
    cloud.point_data["distance"] = distances
    limit = max(float(np.percentile(np.abs(distances), PERCENTILE)), 1e-12)
    return [
        _add(
            plotter, cloud, placed.mesh_matrix, scalars="distance", cmap="RdBu_r", clim=(-limit, limit),
            point_size=5.0, show_scalar_bar=False, lighting=False,
        )
    ]  # fmt: skip


def _draw_plane(plotter: Plotter, placed: Placed, arrangement: Arrangement, view: View) -> list[Any]:
    if not placed.assembly.primitives:
        return []
    axis, at = arrangement.plane(view)
    scale, shift = placed.matrix[0, 0], placed.matrix[:3, 3]
    local = float((at + placed.offset[axis] - shift[axis]) / scale)
    box = assembly_bounds(placed.assembly.on_device("cpu"))
    draw = distance_bands if view.slice else cut_face
    return [_textured(plotter, draw(placed.assembly, axis, local, box), placed.matrix)]


def _textured(plotter: Plotter, picture: PlanePicture, matrix: np.ndarray) -> Any:
    import pyvista as pv

    u, v = picture.axes
    corners = np.tile(picture.low, (4, 1))
    corners[1:3, u] = picture.high[u]
    corners[2:4, v] = picture.high[v]
    quad = pv.PolyData(corners.astype(np.float32), faces=[4, 0, 1, 2, 3])
    quad.active_texture_coordinates = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    # Textures begin with the upper row.
    texture = pv.numpy_to_texture(np.ascontiguousarray(picture.image[::-1]))
    texture.interpolate = True
    return _add(plotter, quad, matrix, texture=texture, lighting=False, color="white")


def _draw_labels(plotter: Plotter, placed: Placed, _: Arrangement, __: View) -> list[Any]:
    parts = placed.assembly.primitives[:MAX_LABELS]
    if not parts:
        return []
    centres = np.array([part.pose.translation for part in parts]) * placed.matrix[0, 0] + placed.matrix[:3, 3]
    actor = plotter.add_point_labels(
        centres.astype(np.float32), [part.name for part in parts], font_size=13, text_color=INK, shape_color="white",
        shape_opacity=0.75, margin=3, show_points=False, always_visible=True, pickable=False, reset_camera=False,
        render=False,
    )  # fmt: skip
    return [actor]


def _by_mesh(placed: Placed, _: Arrangement, view: View) -> Any:
    return view.mesh, placed.mesh_matrix.tobytes(), placed.shows_mesh


def _by_whole(placed: Placed, _: Arrangement, __: View) -> Any:
    return placed.whole, placed.mesh_matrix.tobytes()


def _by_plane(placed: Placed, arrangement: Arrangement, view: View) -> Any:
    return placed.assembly, arrangement.plane(view), view.slice


def _by_places(placed: Placed, _: Arrangement, __: View) -> Any:
    return tuple((part.name, part.pose.translation) for part in placed.assembly.primitives)


LAYERS: dict[str, Layer] = {
    "mesh": Layer(lambda view: view.mesh != "off", _by_mesh, _draw_mesh),
    "error": Layer(lambda view: view.error, _by_whole, _draw_error, slow=True, is_cut=True),
    "residual": Layer(lambda view: view.residual, _by_whole, _draw_residual, slow=True, is_cut=True),
    "samples": Layer(lambda view: view.samples, _by_whole, _draw_samples, slow=True),
    "plane": Layer(lambda view: view.section is not None or view.slice, _by_plane, _draw_plane),
    "labels": Layer(lambda view: view.labels, _by_places, _draw_labels),
}
"""In the order in which they are brought up to date."""
