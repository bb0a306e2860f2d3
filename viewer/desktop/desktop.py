"""The desktop window: a scene, its gizmo and its panel, and the mouse and keys that go to the controller.

Everything also runs off-screen, where tests send the same events.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ..model.edit_state import PartRef
from ..model.poses import pose_matrix
from ..scene.arrangement import Placed
from ..scene.controller import Controller
from ..scene.plotter import is_software, smooth
from ..scene.scene import Scene
from .gizmo import Gizmo, Handle, Ray, dragged
from .panel import Panel
from .panel_layout import WIDTH, Spot, lay_out, list_rows, slider_value
from .window import Drag, Window

SIZE = (1360, 860)
STILL = 0.4
"""Seconds of rest after which edges are smoothed, where that takes longer than the picture."""

CLICK = 4
"""Pixels that the mouse may move in a click."""

DRAGGED = (-1, -1)
"""Where the button went down, once the mouse has moved farther than in a click."""

GIZMO_LAYER, PANEL_LAYER = 1, 2


class Desktop(Window):
    """A window, or its off-screen likeness.

    Attributes:
        controller, scene: what is shown.
        panel, gizmo: what lies over it.
    """

    def __init__(self, controller: Controller) -> None:
        """Lay panel and gizmo over the plotter of a controller's scene, and follow its events."""
        self.controller = controller
        self.scene: Scene = controller.scene
        super().__init__(self.scene.plotter)
        self.gizmo = Gizmo(self.plotter, GIZMO_LAYER)
        self.panel = Panel(self.plotter, PANEL_LAYER)
        self.scroll = 0
        self._listed: PartRef | None = None
        self._pending: Callable[[], None] | None = None
        self._press: tuple[int, int] | None = None
        self._last = (0, 0)
        self._mode: Drag | None = None
        self._grip: tuple[Handle, np.ndarray, Ray] | None = None
        self._dirty = True
        self._smooth = False
        self._changed_at = 0.0
        controller.on_change = self.redraw
        self._observe()
        self.scene.frame()
        self.redraw()

    def begin(self) -> None:
        """Share the window, and frame the scene."""
        self.resize()
        self.scene.frame()

    def redraw(self) -> None:
        """Draw again at the next tick."""
        self._dirty, self._smooth, self._changed_at = True, False, time.monotonic()

    def tick(self) -> None:
        """Do what waits, and draw if something changed."""
        if self._pending is not None:
            pending, self._pending = self._pending, None
            pending()
        if self.controller.closing:
            self.interactor.TerminateApp()
        elif self._dirty:
            self._dirty = False
            self._draw(fine=False)
        elif not self._smooth and self._press is None and time.monotonic() - self._changed_at > STILL:
            self._draw(fine=True)

    def picture(self) -> np.ndarray:
        """Screenshot of the window, panel and all: (height, width, 3) uint8, sRGB, row 0 on top."""
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter

        self._draw(fine=True)
        grabber: Any = vtkWindowToImageFilter()
        grabber.SetInput(self.window)
        grabber.ReadFrontBufferOff()
        grabber.ShouldRerenderOff()
        grabber.Update()
        image: Any = grabber.GetOutput()
        width, height, _ = image.GetDimensions()
        return np.array(vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, 3)[::-1])

    def resize(self) -> None:
        """Share the window between scene and panel."""
        share = max(0.2, 1.0 - WIDTH / max(self.window.GetSize()[0], 1))
        for renderer in (self.plotter.renderer, self.gizmo.renderer):
            renderer.SetViewport(0.0, 0.0, share, 1.0)
        self.redraw()

    def _draw(self, fine: bool) -> None:
        width, height = self.window.GetSize()
        self.scene.look()
        self.gizmo.place(self._part_matrix() if self.controller.gizmo else None, self.scene.camera)
        self.panel.paint(lay_out(self.controller, width, height, self._scrolled(width, height)))
        # With a GPU smoothing costs nothing; without one it waits until all is still.
        self._smooth = fine or not is_software(self.plotter)
        smooth(self.plotter, self._smooth)
        self.window.Render()

    def _scrolled(self, width: int, height: int) -> int:
        """Scroll offset of the list: a part that was just selected is in it."""
        selected = self.controller.session.selected
        if selected != self._listed:
            self._listed = selected
            rows = list_rows(lay_out(self.controller, width, height, self.scroll))
            if selected is not None and rows:
                at = self.controller.session.refs().index(selected)
                self.scroll = min(max(self.scroll, at - rows + 1), at)
        return self.scroll

    def _part_matrix(self) -> np.ndarray | None:
        """(4, 4), local frame of the selected part to the scene's, as it is drawn."""
        ref, session = self.controller.session.selected, self.controller.session
        if ref is None or ref in session.state.hidden or self.scene.view.explode:
            return None
        placed: Placed = self.scene.arrangement.placed[ref.item]
        return placed.matrix @ pose_matrix(session.part(ref).pose)

    # Events

    def _observe(self) -> None:
        handlers = {
            "LeftButtonReleaseEvent": lambda: self._release(click=True),
            "RightButtonReleaseEvent": self._release,
            "MiddleButtonReleaseEvent": self._release,
            "MouseMoveEvent": self._move,
            "MouseWheelForwardEvent": lambda: self._wheel(1),
            "MouseWheelBackwardEvent": lambda: self._wheel(-1),
            "KeyPressEvent": self._key,
        }
        self.observe(self._button, self._orbit, self._pan, self.resize, handlers)
        self.window.AddObserver("WindowResizeEvent", lambda caller, event: self.resize())
        self.resize()

    def _button(self, mode: Drag) -> None:
        x, y = self.interactor.GetEventPosition()
        self._press = self._last = x, y
        spot = self._spot(x, y)
        if spot is not None:
            self._mode = None
            self._click_spot(spot, x)
            return
        handle = self.gizmo.at(x, y)
        if handle is not None:
            matrix = self.gizmo.matrix.copy()
            self._grip = handle, matrix, self._ray(x, y)
            self.controller.hold()
            self._mode = self._drag_gizmo
        else:
            self._mode = self._pan if self.interactor.GetShiftKey() else mode

    def _release(self, click: bool = False) -> None:
        x, y = self.interactor.GetEventPosition()
        press, mode = self._press, self._mode
        self._press = self._mode = None
        if self._pending is not None:
            pending, self._pending = self._pending, None
            pending()
        if mode in (self._drag_gizmo, self._drag_slider):
            self._grip = None
            self.controller.settle()
        elif click and mode is not None and press not in (None, DRAGGED):
            self.controller.pick(x, y)
        self.redraw()

    def _move(self) -> None:
        x, y = self.interactor.GetEventPosition()
        if self._mode is not None:
            self._mode(x, y)
        elif self._press is None and self._spot(x, y) is None and self.gizmo.light(self.gizmo.at(x, y)):
            self.redraw()

    def _orbit(self, x: int, y: int) -> None:
        if self._moved(x, y):
            self.scene.camera.orbit(x - self._last[0], y - self._last[1])
            self._last = x, y
            self.redraw()

    def _pan(self, x: int, y: int) -> None:
        if self._moved(x, y):
            self.scene.camera.pan(x - self._last[0], y - self._last[1], self._size()[1])
            self._last = x, y
            self.redraw()

    def _moved(self, x: int, y: int) -> bool:
        """True for a drag, and not the tremble of a click."""
        if self._press is None:
            return False
        if abs(x - self._press[0]) + abs(y - self._press[1]) >= CLICK:
            self._press = DRAGGED
        return self._press == DRAGGED

    def _drag_gizmo(self, x: int, y: int) -> None:
        if self._grip is not None:
            handle, matrix, begin = self._grip
            facing = self.scene.camera.view().axes[2]
            moved = dragged(handle, matrix, begin, self._ray(x, y), facing)
            self._pending = lambda: self.controller.drag(moved)

    def _drag_slider(self, x: int, _: int) -> None:
        spot = self._slider
        slider = next((found for found in self.controller.sliders() if found.id == spot.id), None)
        if slider is not None:
            value = slider_value(spot, slider, x)
            self._pending = lambda: self.controller.slide(slider.id, value)

    def _click_spot(self, spot: Spot, x: int) -> None:
        controller = self.controller
        if spot.kind == "slider":
            self._slider, self._mode = spot, self._drag_slider
            self._drag_slider(x, 0)
        elif spot.kind == "value":
            controller.type_value(spot.id)
        elif spot.kind == "part":
            controller.select(spot.id)
        elif spot.kind == "hide":
            controller.session.hide(spot.id)
            controller.changed()
        elif spot.kind == "only":
            controller.session.isolate(spot.id)
            controller.changed()
        elif spot.kind == "command":
            controller.run(spot.id)
        elif spot.kind == "family":
            controller.add(spot.id)

    def _wheel(self, step: int) -> None:
        x, y = self.interactor.GetEventPosition()
        if self._spot(x, y) is None:
            self.scene.camera.zoom(0.9**step)
        else:
            hidden = len(self.controller.session.refs()) - list_rows(self.panel.drawing)
            self.scroll = max(0, min(self.scroll - 2 * step, hidden))
        self.redraw()

    def _key(self) -> None:
        if self.interactor.GetControlKey():
            name = self.interactor.GetKeySym() or ""
            key = f"ctrl+{name.upper() if self.interactor.GetShiftKey() else name.lower()}"
        else:
            key = self.pressed_key()
        self.controller.press(key)

    def _spot(self, x: int, y: int) -> Spot | None:
        return self.panel.drawing.at(x, self.window.GetSize()[1] - 1 - y)

    def _ray(self, x: int, y: int) -> Ray:
        return self.scene.camera.ray(x, y, self._size())

    def _size(self) -> tuple[int, int]:
        width, height = self.plotter.renderer.GetSize()
        return max(width, 1), max(height, 1)
