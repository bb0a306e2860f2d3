"""The scene: assemblies, their parts and all layers as actors of one plotter, brought up to date by `sync`.

It knows nothing of windows, keys or mice: the desktop window, a page served from here, pictures and films draw it
alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..model.comparison import Comparison
from ..model.edit_session import EditSession
from ..model.edit_state import PartRef
from ..model.view_options import View
from .arrangement import Arrangement, arrange
from .camera import OrbitCamera
from .layers import Layers
from .part_actors import PartActors
from .plotter import Plotter
from .surface_cache import PART_CELLS


class Scene:
    """Rendered scene of a session and a view.

    Attributes:
        session: the assemblies that are shown.
        view: how; set it and call `sync`.
        camera: from where; change it and call `look`.
        arrangement: where everything was put by the last `sync`.
    """

    def __init__(
        self,
        plotter: Plotter,
        session: EditSession,
        comparisons: Sequence[Comparison | None] = (),
        view: View | None = None,
        camera: OrbitCamera | None = None,
        device: str = "auto",
        cells: int = PART_CELLS,
    ) -> None:
        """Draw into a plotter.

        Args:
            plotter: from `stage.make_plotter`.
            session: what to draw.
            comparisons: the targets, one an assembly, None where there is none.
            view, camera: the usual ones unless given.
            device: where surfaces are computed.
            cells: along the longest side of a part at rest.
        """
        self.plotter = plotter
        self.session = session
        self.comparisons = tuple(comparisons) or (None,) * len(session.state.assemblies)
        self.view = view or View()
        self.camera = camera or OrbitCamera()
        self.parts = PartActors(plotter, device, cells)
        self.layers = Layers(plotter)
        self._planes: dict[int, Any] = {}
        self.arrangement: Arrangement = arrange(session, self.view, self.comparisons)
        self.sync()
        self.frame()

    def sync(self, live: bool = False) -> None:
        """Bring all actors up to date; draws nothing yet.

        Args:
            live: whether something is being dragged: surfaces are coarse then, and slow layers wait.
        """
        self.arrangement = arrange(self.session, self.view, self.comparisons)
        self.parts.sync(self.arrangement, self.view, self.session.selected, live)
        self.layers.sync(self.arrangement, self.view, live)
        self._cut()

    def look(self) -> None:
        """Make the plotter's camera that of the scene."""
        self.camera.apply(self.plotter.renderer)

    def frame(self) -> None:
        """See everything."""
        width, height = self.plotter.renderer.GetSize()
        if not (width and height):
            width, height = self.plotter.window_size
        self.camera.frame(self.points(), width / height)
        self.look()

    def points(self) -> np.ndarray:
        """Visible points, (n, 3), scene's frame."""
        points = [self.parts.points()]
        for placed in self.arrangement.placed:
            if (
                placed.comparison is not None
                and placed.shows_mesh
                and (self.view.mesh != "off" or self.view.error)
            ):
                vertices = placed.comparison.surface[0]
                points.append(vertices @ placed.mesh_matrix[:3, :3].T + placed.mesh_matrix[:3, 3])
        found = np.concatenate(points)
        return found if len(found) else np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])

    def pick(self, x: float, y: float) -> PartRef | None:
        """The part at a pixel of the window, counted from its lower left corner."""
        from vtkmodules.vtkRenderingCore import vtkCellPicker

        picker = vtkCellPicker()
        picker.SetTolerance(0.0)
        picker.PickFromListOn()
        for actor in self.parts.bodies:
            if actor.visibility:
                picker.AddPickList(actor)
        if not picker.Pick(x, y, 0.0, self.plotter.renderer):
            return None
        return self.parts.at(picker.GetActor(), picker.GetCellId())

    def _cut(self) -> None:
        """Clip what lies beyond the section's plane, towards the eye."""
        from vtkmodules.vtkCommonDataModel import vtkPlane

        axis, at = self.arrangement.plane(self.view)
        for placed in self.arrangement.placed:
            plane = self._planes.setdefault(placed.item, vtkPlane())
            normal, origin = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
            normal[axis], origin[axis] = -1.0, at + float(placed.offset[axis])
            plane.SetNormal(normal)
            plane.SetOrigin(origin)
            actors: list[Any] = [*self.parts.of_item(placed.item), *self.layers.cut_with(placed.item)]
            for actor in actors:
                # Asked first, because a mapper that was touched is set up anew for the next picture.
                planes = actor.mapper.GetClippingPlanes()
                is_cut = planes is not None and planes.GetNumberOfItems() > 0
                if self.view.section is not None and not is_cut:
                    actor.mapper.AddClippingPlane(plane)
                elif self.view.section is None and is_cut:
                    actor.mapper.RemoveAllClippingPlanes()
