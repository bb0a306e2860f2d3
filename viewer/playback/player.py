"""The window that plays steps one after the other: a fit's history, or a fit while it goes on.

Steps may be added while it is open; who stands at the last one goes along. Everything also runs off-screen.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from ..desktop.panel import Panel
from ..desktop.panel_layout import ACCENT, LINE, MUTED, PAPER, TRACK, Drawing, Text
from ..desktop.window import Drag, Window
from ..model.commands import find_command
from ..model.view_options import COMPARING, SWITCHES, switched
from ..scene.opengl_check import DisplayError, finish_probe, has_display, require, start_probe
from ..scene.plotter import Plotter, is_software, make_plotter, smooth
from ..scene.request import Request, check_compared, first_view, open_session, read_camera
from .playback import Frame, load_playback
from .playback_scene import PANEL_LAYER, StepScene, paint_caption

SIZE = (1120, 780)
STEP_SECONDS = 0.7
"""That a step is shown while the history plays."""

FOOT, MARGIN = 44, 20
"""Height of the strip with the slider, and what is left of it at its ends, pixels."""

HINT = "Left Right  step    Home End    Space  play    M  input    J  joins    E  apart    Q  close"
LOOKS = (*SWITCHES, "frame", "front", "side", "top", "up")
ANGLES = {"front": (0.0, 0.0), "side": (90.0, 0.0), "top": (0.0, 88.0)}


class Player(Window):
    """A window, or its off-screen likeness.

    Attributes:
        frames: the steps so far.
        at: which one is shown.
        playing: whether it goes on by itself.
        closing: whether the window is to close.
        on_tick: called some sixty times a second while the window is open.
    """

    def __init__(self, plotter: Plotter, scene: StepScene, frames: Sequence[Frame], at: int = 0) -> None:
        """Lay caption and slider over a scene.

        Args:
            plotter: that of the scene.
            scene: what draws steps.
            frames: at least one.
            at: the first one to show.
        """
        super().__init__(plotter)
        self.scene, self.frames, self.at = scene, list(frames), at
        self.panel = Panel(plotter, PANEL_LAYER)
        self.playing = self.closing = False
        self.on_tick: Callable[[], None] = lambda: None
        self._shown: Frame | None = None
        self._dirty, self._next, self._last = True, 0.0, (0, 0)
        self._drag: Drag | None = None
        self._observe()
        self._leave_room()
        self.scene.scene.frame()

    def begin(self) -> None:
        """Keep the scene above the slider, and frame it."""
        self._leave_room()
        self.scene.scene.frame()

    def add(self, frame: Frame) -> None:
        """Put a step after the last one."""
        follows = self.at == len(self.frames) - 1
        self.frames.append(frame)
        if follows:
            self.go(len(self.frames) - 1)
        self._dirty = True

    def go(self, at: int) -> None:
        """Show a step; beyond the ends those are shown."""
        self.at = max(0, min(at, len(self.frames) - 1))
        self._dirty = True

    def press(self, key: str) -> None:
        """Do what a key stands for."""
        last = len(self.frames) - 1
        steps = {"Left": self.at - 1, "Right": self.at + 1, "Home": 0, "End": last}
        command = find_command(key)
        if key in steps:
            self.playing = False
            self.go(steps[key])
        elif key in (" ", "space"):
            self.playing = not self.playing
            if self.playing and self.at == last:
                self.go(0)
            self._next = time.monotonic() + STEP_SECONDS
        elif key in ("q", "ctrl+q", "Escape"):
            self.closing = True
        elif command is not None and command.name in LOOKS:
            self._look(command.name)
        self._dirty = True

    def tick(self) -> None:
        """Go on where it plays, and draw if something changed."""
        self.on_tick()
        if self.closing:
            self.interactor.TerminateApp()
            return
        if self.playing and time.monotonic() >= self._next:
            self._next = time.monotonic() + STEP_SECONDS
            self.go(self.at + 1)
            self.playing = self.at < len(self.frames) - 1
        if self._dirty:
            self.draw()

    def draw(self) -> None:
        """Draw the step of the moment."""
        self._dirty, frame = False, self.frames[self.at]
        if self._shown is not frame:
            self.scene.show(frame)
            self._shown = frame
        self.scene.look()
        self.panel.paint(self._drawing())
        smooth(self.plotter, not is_software(self.plotter))
        self.window.Render()

    def _drawing(self) -> Drawing:
        width, height = self.window.GetSize()
        drawing, frame, top = Drawing(), self.frames[self.at], height - FOOT
        paint_caption(drawing, frame, width, height)
        drawing.box(0, top, width, FOOT, PAPER)
        drawing.box(0, top, width, 1, LINE)
        count, middle = len(self.frames), top + 14
        drawing.box(MARGIN, middle - 2, width - 2 * MARGIN, 4, TRACK, 2)
        begins = [k for k in range(1, count) if self.frames[k].round != self.frames[k - 1].round]
        for k in begins if len(begins) < width / 8 else []:
            drawing.box(self._place(k, width) - 1, middle - 5, 2, 10, TRACK)
        drawing.box(MARGIN, middle - 2, self._place(self.at, width) - MARGIN + 1, 4, ACCENT, 2)
        drawing.disc(self._place(self.at, width), middle, 7, ACCENT)
        drawing.texts.append(Text(MARGIN, top + 33, HINT, 11, MUTED))
        said = f"step {self.at + 1} of {count}" + (" · playing" if self.playing else "")
        drawing.texts.append(Text(width - MARGIN, top + 33, said, 11, MUTED, "right"))
        return drawing

    def _place(self, at: int, width: int) -> float:
        return MARGIN + (width - 2 * MARGIN) * at / max(1, len(self.frames) - 1)

    def _look(self, name: str) -> None:
        scene = self.scene.scene
        if name in COMPARING and not any(scene.comparisons):
            return
        if name in ANGLES:
            scene.camera.azimuth, scene.camera.elevation = ANGLES[name]
        elif name == "up":
            scene.camera.up = "z" if scene.camera.up == "y" else "y"
        elif name in SWITCHES:
            scene.view = switched(scene.view, name, scene.camera.across())
            # Explosions and what stands beside change how much there is to see.
            name = "frame" if name in ("explode", "mesh") else name
        self.scene.show(self.frames[self.at])
        if name == "frame":
            scene.frame()

    # Events

    def _observe(self) -> None:
        handlers = {
            "LeftButtonReleaseEvent": self._release,
            "RightButtonReleaseEvent": self._release,
            "MiddleButtonReleaseEvent": self._release,
            "MouseMoveEvent": self._move,
            "MouseWheelForwardEvent": lambda: self._zoom(0.9),
            "MouseWheelBackwardEvent": lambda: self._zoom(1.0 / 0.9),
            "KeyPressEvent": lambda: self.press(self.pressed_key()),
        }
        self.observe(self._button, self._orbit, self._pan, self._leave_room, handlers)

    def _leave_room(self) -> None:
        """Keep the scene above the slider."""
        share = min(0.5, FOOT / max(1, self.window.GetSize()[1]))
        for renderer in (self.plotter.renderer, self.scene.over):
            renderer.SetViewport(0.0, share, 1.0, 1.0)
        self._dirty = True

    def _button(self, drag: Drag) -> None:
        x, y = self._last = self.interactor.GetEventPosition()
        self._drag = self._slide if y < FOOT else self._pan if self.interactor.GetShiftKey() else drag
        if y < FOOT:
            self._slide(x, y)

    def _release(self) -> None:
        self._drag = None

    def _move(self) -> None:
        x, y = self.interactor.GetEventPosition()
        if self._drag is not None:
            self._drag(x, y)
            self._last = x, y
            self._dirty = True

    def _slide(self, x: int, _: int) -> None:
        share = (x - MARGIN) / max(1, self.window.GetSize()[0] - 2 * MARGIN)
        self.playing = False
        self.go(round(share * (len(self.frames) - 1)))

    def _orbit(self, x: int, y: int) -> None:
        self.scene.scene.camera.orbit(x - self._last[0], y - self._last[1])

    def _pan(self, x: int, y: int) -> None:
        self.scene.scene.camera.pan(x - self._last[0], y - self._last[1], self.window.GetSize()[1])

    def _zoom(self, factor: float) -> None:
        self.scene.scene.camera.zoom(factor)
        self._dirty = True


def open_player(request: Request) -> None:
    """Step through the history of the fit that is asked for, until the window is closed.

    Raises:
        InputError: if there is no history, or something cannot be read.
        DisplayError: if there is no screen, or nothing can be drawn on it.
    """
    from .film import fit_folder

    folder, camera = fit_folder(request), read_camera(request)
    view = first_view(request, camera)
    if not has_display():
        raise DisplayError("there is no screen to open a window on; write a film with --video FILE instead.")
    probe = start_probe(off_screen=False)
    try:
        documents, _, comparisons = open_session(request)
        check_compared(view, comparisons)
        frames = load_playback(folder, documents[0].assembly)
    finally:
        answer = finish_probe(probe)
    require(answer)
    plotter = make_plotter(request.size or SIZE, off_screen=False, title=f"resfit · {documents[0].title}")
    scene = StepScene(plotter, frames[-1].assembly, comparisons[0], view, camera, request.device)
    Player(plotter, scene, frames).run()
