"""A window whose mouse and keys go to its subclass alone, and to nothing of VTK or PyVista."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ..scene.plotter import Plotter

TICK = 15
"""Milliseconds between looks at what is to be done: of many moves of the mouse only the last counts."""

FIRST = 10.0
"""Priority of observers: before VTK's own."""

NAMES = {
    "question": "?",
    "bracketleft": "[",
    "bracketright": "]",
    "KP_Enter": "Return",
    "ISO_Left_Tab": "Tab",
}

Drag = Callable[[int, int], None]
"""What moves of the mouse do, while a button is down, with the pixel that it is at."""


class Window:
    """A plotter's window, or its off-screen likeness.

    Attributes:
        plotter: what draws.
        window: VTK's.
    """

    def __init__(self, plotter: Plotter) -> None:
        """Take the window of a plotter; nothing is observed yet."""
        self.plotter = plotter
        self.window: Any = plotter.render_window

    @property
    def interactor(self) -> Any:
        """VTK's interactor."""
        return self.plotter.iren.interactor

    def run(self) -> None:
        """Show the window until it is closed."""
        self.plotter.show(interactive=False, auto_close=False)
        self._take_over()
        self.begin()
        self.tick()
        self.interactor.CreateRepeatingTimer(TICK)
        self.interactor.Start()
        self.plotter.close()

    def begin(self) -> None:
        """Make the picture fit the window, once it is shown."""
        raise NotImplementedError

    def tick(self) -> None:
        """Do what waits, and draw if something changed."""
        raise NotImplementedError

    def observe(
        self,
        button: Callable[[Drag], None],
        orbit: Drag,
        pan: Drag,
        resize: Callable[[], None],
        handlers: Mapping[str, Callable[[], None]],
    ) -> None:
        """Call methods at events.

        Args:
            button: at the press of a button, with what a drag of it does.
            orbit, pan: the drags of the left button, and of the others.
            resize: when the window has another size.
            handlers: the others, by VTK's name of the event.
        """
        self._take_over()
        all_handlers = {
            "LeftButtonPressEvent": lambda: button(orbit),
            "RightButtonPressEvent": lambda: button(pan),
            "MiddleButtonPressEvent": lambda: button(pan),
            "ConfigureEvent": resize,
            "WindowResizeEvent": resize,
            "TimerEvent": self.tick,
            **handlers,
        }
        for event, handler in all_handlers.items():
            self.interactor.AddObserver(event, _calling(handler), FIRST)

    def pressed_key(self) -> str:
        """The key of the moment: the letter that it prints, or its name."""
        name, code = self.interactor.GetKeySym() or "", self.interactor.GetKeyCode() or ""
        return code if code.isprintable() and code not in ("", "\0") else NAMES.get(name, name)

    def _take_over(self) -> None:
        """Switch off what VTK and PyVista do with keys and drags: it would come on top of ours."""
        self.interactor.SetInteractorStyle(None)
        self.interactor.EnableRenderOff()


def _calling(handler: Callable[[], None]) -> Callable[[Any, str], None]:
    """An observer that calls a handler without arguments."""
    return lambda caller, event: handler()
