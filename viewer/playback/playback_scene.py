"""Steps of a playback as a picture: parts as in any scene, candidates as veils, regions as wire boxes, a caption."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...assembly.assembly import Assembly
from ..desktop.panel_layout import ACCENT, INK, MUTED, PAPER, Drawing, Text, shorten
from ..model.comparison import Comparison
from ..model.edit_session import EditSession
from ..model.edit_state import State
from ..model.poses import pose_matrix
from ..model.view_options import View
from ..scene.camera import OrbitCamera
from ..scene.plotter import Plotter
from ..scene.scene import Scene
from ..scene.surface_cache import PartSurfaces
from .playback import Frame

if TYPE_CHECKING:
    import pyvista as pv

CANDIDATE, BOX = "#3b6ea8", "#2f5a91"
CANDIDATE_STRENGTH, BOX_STRENGTH = 0.16, 0.5
VEILS = 10
"""Candidates from which on each is drawn the fainter, the more there are."""

OVER_LAYER, PANEL_LAYER = 1, 2
"""Candidates and regions lie inside parts too: they are drawn over them."""

REACH = 2.5
"""Scene units around what is looked at in which regions and candidates lie."""

CANDIDATE_CELLS = 10
"""Along the longest side: veils have no details, and there may be hundreds."""

EDGES = ((0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7))
"""Of a box, its corners numbered by the bits of z, y and x."""


class StepScene:
    """A scene that shows one step at a time.

    Attributes:
        scene: the parts; its view and camera may be changed as in any scene.
    """

    def __init__(
        self,
        plotter: Plotter,
        first: Assembly,
        comparison: Comparison | None = None,
        view: View | None = None,
        camera: OrbitCamera | None = None,
        device: str = "auto",
    ) -> None:
        """Draw into a plotter.

        Args:
            plotter: from `stage.make_plotter`.
            first: what the camera frames; all steps share its transform.
            comparison: the input, if it is at hand.
            view, camera: the usual ones unless given.
            device: where surfaces are computed.
        """
        self.plotter = plotter
        self.session = EditSession([first])
        self.scene = Scene(plotter, self.session, [comparison], view, camera, device)
        self.surfaces = PartSurfaces(device)
        self.over = _layer_over(plotter)
        self.faint, self.boxes = self._actor(CANDIDATE), self._actor(BOX)
        self.boxes.prop.line_width, self.boxes.prop.lighting = 1.0, False
        self._shown: tuple[Any, Any] = (None, None)

    def show(self, frame: Frame) -> None:
        """Bring the scene to a step; draws nothing yet."""
        self.session.state = State((frame.assembly,))
        self.scene.sync()
        if self._shown[0] is not frame.faint:
            self.faint.mapper.dataset = self._veils(frame)
        if self._shown[1] is not frame.boxes:
            self.boxes.mapper.dataset = _wires(frame.boxes)
        self._shown = frame.faint, frame.boxes
        # Apart from each other, parts are no longer where candidates and regions are.
        strength = 0.0 if self.scene.view.explode else frame.strength
        for actor, there, full in (
            (self.faint, bool(frame.faint), CANDIDATE_STRENGTH * min(1.0, VEILS / max(1, len(frame.faint)))),
            (self.boxes, bool(len(frame.boxes)), BOX_STRENGTH),
        ):
            actor.visibility = there and strength > 0.0
            actor.prop.opacity = full * strength

    def look(self) -> None:
        """Make the plotter's camera that of the scene, with room for what lies around the parts."""
        self.scene.look()
        camera, away = self.plotter.renderer.GetActiveCamera(), self.scene.camera.distance
        near, far = camera.GetClippingRange()
        camera.SetClippingRange(min(near, max(0.01 * away, away - REACH)), max(far, away + REACH))

    def _veils(self, frame: Frame) -> pv.PolyData:
        """All candidates as one mesh."""
        vertices, faces, count = [np.zeros((0, 3), np.float32)], [np.zeros((0, 3), np.int64)], 0
        for part in frame.faint:
            points, triangles = self.surfaces.surface(part, CANDIDATE_CELLS)
            matrix = pose_matrix(part.pose)
            vertices.append((points @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32))
            faces.append(triangles + count)
            count += len(points)
        return _poly(np.concatenate(vertices), np.concatenate(faces))

    def _actor(self, color: str) -> Any:
        import pyvista as pv

        mapper = pv.DataSetMapper(dataset=pv.PolyData())
        mapper.scalar_visibility = False
        actor = pv.Actor(mapper=mapper)
        actor.prop.color, actor.pickable = color, False
        actor.prop.ambient, actor.prop.diffuse, actor.prop.specular = 0.55, 0.5, 0.0
        self.over.AddActor(actor)
        return actor


def paint_caption(drawing: Drawing, frame: Frame, width: int, height: int) -> None:
    """Write what a step is in the upper left corner of a picture, sizes in pixels."""
    size = max(11, min(22, round(height / 34)))
    pad, room = size, width - 3 * size
    title, detail = shorten(frame.title, room, size), shorten(frame.detail, room, size - 2)
    drawing.texts.append(Text(pad, 1.5 * size, title, size, INK, bold=True))
    drawing.texts.append(Text(pad, 2.9 * size, detail, max(9, size - 3), MUTED))


def paint_line(drawing: Drawing, share: float, width: int, height: int) -> None:
    """Show along the lower edge of a picture how far a film is, 0 to 1."""
    thick = max(2, round(height / 180))
    drawing.box(0, height - thick, width, thick, PAPER)
    drawing.box(0, height - thick, max(1.0, share * width), thick, ACCENT)


def _layer_over(plotter: Plotter) -> Any:
    """A renderer over that of a plotter, which looks through the same camera."""
    from vtkmodules.vtkRenderingCore import vtkRenderer

    renderer: Any = vtkRenderer()
    renderer.SetLayer(OVER_LAYER)
    renderer.InteractiveOff()
    renderer.SetActiveCamera(plotter.renderer.GetActiveCamera())
    window = plotter.render_window
    window.SetNumberOfLayers(max(OVER_LAYER + 1, window.GetNumberOfLayers()))
    window.AddRenderer(renderer)
    return renderer


def _poly(vertices: np.ndarray, faces: np.ndarray) -> Any:
    import pyvista as pv

    return pv.PolyData.from_regular_faces(vertices, faces) if len(faces) else pv.PolyData()


def _wires(boxes: np.ndarray) -> Any:
    """The edges of boxes (n, 2, 3) as lines."""
    import pyvista as pv

    if not len(boxes):
        return pv.PolyData()
    bits = np.array([[corner >> 2 & 1, corner >> 1 & 1, corner & 1] for corner in range(8)])
    corners = np.stack([boxes[:, bits[:, axis], axis] for axis in range(3)], axis=2)
    lines = (8 * np.arange(len(boxes)))[:, None, None] + np.asarray(EDGES)
    cells = np.insert(lines.reshape(-1, 2), 0, 2, axis=1)
    return pv.PolyData(corners.reshape(-1, 3).astype(np.float32), lines=cells.ravel())
