"""The parts of a scene as actors: one mesh each, made anew only where a shape changed; and the smooth union."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...assembly.assembly import Assembly
from ...assembly.primitive import Primitive
from ..model.edit_state import PartRef
from ..model.poses import pose_matrix
from ..model.view_options import View
from .arrangement import Arrangement, Placed
from .plotter import INK, Plotter, to_edges, to_poly
from .surface_cache import (
    LIVE_CELLS,
    LIVE_UNION_CELLS,
    PART_CELLS,
    UNION_SHARE,
    PartSurfaces,
    joined_surface,
    shape_key,
)

ACCENT = "#e0780a"
"""Edges of the part that is selected."""

MANY_PARTS = 256
"""Where there are more, each is small in the picture, and drawn as coarsely as one that is dragged."""

AMBIENT = 0.3
BESIDE_RESIDUAL = 0.14
"""Opacity of the parts while what is left over is shown."""


@dataclass
class PartActor:
    """Actors of one part."""

    poly: Any
    lines: Any
    body: Any
    edges: Any
    shape: Hashable = None
    look: Any = None
    """What its place and properties were made from."""


@dataclass
class JoinedActor:
    """Actors of one assembly as a whole."""

    poly: Any
    body: Any
    key: Any = None
    owners: np.ndarray | None = None
    names: tuple[str, ...] = ()


class PartActors:
    """All parts of all assemblies.

    Attributes:
        surfaces: where their meshes come from.
    """

    def __init__(self, plotter: Plotter, device: str = "auto", cells: int = PART_CELLS) -> None:
        """Draw into a plotter, with surfaces from `device`, `cells` along a part's longest side."""
        self.plotter, self.cells = plotter, cells
        self.surfaces = PartSurfaces(device)
        self.parts: dict[PartRef, PartActor] = {}
        self.joined: dict[int, JoinedActor] = {}

    def sync(self, arrangement: Arrangement, view: View, selected: PartRef | None, live: bool) -> None:
        """Draw what is there now.

        Args:
            arrangement: assemblies in their places.
            view: how to draw.
            selected: the part to mark.
            live: whether something is being dragged: new surfaces are coarse then.
        """
        present: set[PartRef] = set()
        count = sum(len(placed.assembly.primitives) for placed in arrangement.placed)
        cells = LIVE_CELLS if count > MANY_PARTS else self.cells
        for placed in arrangement.placed:
            self._sync_joined(placed, view, live)
            for part in placed.assembly.primitives:
                ref = PartRef(placed.item, part.name)
                present.add(ref)
                self._sync_part(ref, part, placed.matrix, view, ref == selected, cells, live)
        for ref in set(self.parts) - present:
            gone = self.parts.pop(ref)
            self.plotter.remove_actor([gone.body, gone.edges], render=False)

    def at(self, actor: Any, cell: int) -> PartRef | None:
        """The part that an actor's cell belongs to."""
        for ref, part in self.parts.items():
            if part.body is actor:
                return ref
        for item, joined in self.joined.items():
            if joined.body is actor and joined.owners is not None and 0 <= cell < len(joined.owners):
                return PartRef(item, joined.names[joined.owners[cell]])
        return None

    @property
    def bodies(self) -> list[Any]:
        """Everything that can be picked, and is cut by sections."""
        shown = [part.body for part in self.parts.values()]
        return [*shown, *(joined.body for joined in self.joined.values())]

    def points(self) -> np.ndarray:
        """All vertices (n, 3) of what is there, scene's frame."""
        drawn = [(part.poly, part.body) for part in self.parts.values()]
        drawn += [(joined.poly, joined.body) for joined in self.joined.values()]
        found = [np.zeros((0, 3))]
        for poly, body in drawn:
            if poly.n_points:
                matrix = body.user_matrix
                found.append(np.asarray(poly.points) @ matrix[:3, :3].T + matrix[:3, 3])
        return np.concatenate(found)

    def of_item(self, item: int) -> list[Any]:
        """All actors of one assembly."""
        actors = [
            actor for ref, part in self.parts.items() if ref.item == item for actor in (part.body, part.edges)
        ]
        return [*actors, self.joined[item].body] if item in self.joined else actors

    def _sync_part(
        self,
        ref: PartRef,
        part: Primitive,
        matrix: np.ndarray,
        view: View,
        selected: bool,
        cells: int,
        live: bool,
    ) -> None:
        if live and not self.surfaces.has(part, cells):
            cells = LIVE_CELLS
        shape = shape_key(part, cells)
        if ref not in self.parts:
            self.parts[ref] = self._make_part()
        drawn = self.parts[ref]
        if drawn.shape != shape:
            surface = self.surfaces.surface(part, cells)
            drawn.poly.copy_from(to_poly(surface))
            drawn.lines.copy_from(to_edges(surface))
            drawn.shape = shape
        look = part.pose, part.color, matrix.tobytes(), view, selected
        if drawn.look != look:
            drawn.look = look
            self._dress(drawn, part, matrix, view, selected)

    @staticmethod
    def _dress(drawn: PartActor, part: Primitive, matrix: np.ndarray, view: View, selected: bool) -> None:
        placed = matrix @ pose_matrix(part.pose)
        drawn.body.user_matrix = placed
        drawn.edges.user_matrix = placed
        drawn.body.prop.color = part.color
        drawn.body.prop.culling = _culling(view)
        drawn.body.prop.style = "wireframe" if view.wireframe else "surface"
        drawn.body.prop.ambient = 0.5 if selected else AMBIENT
        # What is left over lies inside parts as well as outside.
        drawn.body.prop.opacity = BESIDE_RESIDUAL if view.residual and not selected else 1.0
        drawn.edges.prop.color = ACCENT if selected else INK
        drawn.edges.prop.line_width = 3.0 if selected else 1.2
        lined = view.edges and not (view.wireframe or view.error)
        drawn.body.visibility, drawn.edges.visibility = not view.error, lined or selected

    def _sync_joined(self, placed: Placed, view: View, live: bool) -> None:
        """Draw the smooth union too: it shows where parts run into each other, and lies on them elsewhere.

        While anything but a blend is dragged it waits: parts alone follow faster than the eye minds.
        """
        old, parts = self.joined.get(placed.item), placed.assembly.primitives
        wanted = view.joined and any(part.blend > 0.0 for part in parts[1:])
        wanted = wanted and not (view.error or view.residual or view.wireframe)
        fine = (placed.assembly, UNION_SHARE * self.cells)
        key = (placed.assembly, LIVE_UNION_CELLS) if live and (old is None or old.key != fine) else fine
        if wanted and live and old is not None and old.key != key:
            wanted = _differ_in_blends(old.key[0], placed.assembly)
        if not wanted:
            if old is not None:
                old.body.visibility = False
            return
        drawn = self.joined[placed.item] = old or self._make_joined()
        if drawn.key != key:
            surface = joined_surface(*key, self.surfaces.device)
            poly = to_poly((surface.vertices, surface.faces), colors=surface.colors)
            if poly.n_points:
                poly.set_active_scalars("colors")
            drawn.poly.copy_from(poly)
            drawn.body.mapper.scalar_visibility = True
            drawn.key, drawn.owners = key, surface.owners
            drawn.names = tuple(part.name for part in parts)
        drawn.body.user_matrix = placed.matrix
        drawn.body.prop.culling = _culling(view)
        drawn.body.visibility = True

    def _make_joined(self) -> JoinedActor:
        poly, body = self._actor()
        body.mapper.SetColorModeToDirectScalars()
        # Where both surfaces are the same, the part's own is the sharper one: it goes in front.
        body.mapper.SetResolveCoincidentTopologyToPolygonOffset()
        body.mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(1.0, 8.0)
        return JoinedActor(poly, body)

    def _make_part(self) -> PartActor:
        poly, body = self._actor()
        lines, edges = self._actor()
        edges.pickable = False
        edges.prop.lighting = False
        # Lines lie in the surface: pull them towards the eye.
        edges.mapper.SetResolveCoincidentTopologyToPolygonOffset()
        edges.mapper.SetRelativeCoincidentTopologyLineOffsetParameters(0.0, -4.0)
        return PartActor(poly, lines, body, edges)

    def _actor(self) -> tuple[Any, Any]:
        import pyvista as pv

        poly = pv.PolyData()
        mapper = pv.DataSetMapper(dataset=poly)
        mapper.scalar_visibility = False
        actor = pv.Actor(mapper=mapper)
        actor.prop.interpolation = "Phong"
        actor.prop.ambient, actor.prop.diffuse = AMBIENT, 0.84
        actor.prop.specular, actor.prop.specular_power = 0.12, 24.0
        self.plotter.add_actor(actor, reset_camera=False, render=False)
        return poly, actor


def _differ_in_blends(a: Assembly, b: Assembly) -> bool:
    """True if two assemblies are the same but for blends."""
    if len(a.primitives) != len(b.primitives):
        return False
    pairs = zip(a.primitives, b.primitives, strict=True)
    return all(one is other or replace(one, blend=other.blend) == other for one, other in pairs)


def _culling(view: View) -> str:
    """Face culling: insides are left out, unless something is cut open; saves time without a GPU."""
    return "none" if view.section else "back"
