"""Windows of VTK: which method is called at which event, and what a key is called."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from resfit.viewer.desktop.window import Window


class Interactor(SimpleNamespace):
    """Stands in for VTK's: it remembers its observers."""

    def AddObserver(self, event: str, call: Callable[[Any, str], None], priority: float) -> None:
        self.observers[event] = call

    def SetInteractorStyle(self, style: None) -> None:
        self.style = style

    def EnableRenderOff(self) -> None:
        self.draws_alone = False

    def GetKeySym(self) -> str:
        return self.sym

    def GetKeyCode(self) -> str:
        return self.code


def made() -> tuple[Any, Interactor]:
    interactor = Interactor(observers={}, style="VTK's", draws_alone=True)
    plotter: Any = SimpleNamespace(render_window=None, iren=SimpleNamespace(interactor=interactor))
    return Window(plotter), interactor


def test_events_reach_their_methods() -> None:
    window, interactor = made()
    done: list[Any] = []
    window.tick = lambda: done.append("tick")
    window.observe(
        done.append,
        "orbit",
        "pan",
        lambda: done.append("resize"),
        {"KeyPressEvent": lambda: done.append("key")},
    )
    events = [
        "LeftButtonPressEvent",
        "RightButtonPressEvent",
        "TimerEvent",
        "ConfigureEvent",
        "KeyPressEvent",
    ]
    for event in events:
        interactor.observers[event](None, event)
    assert done == ["orbit", "pan", "tick", "resize", "key"]
    assert interactor.style is None and not interactor.draws_alone


@pytest.mark.parametrize(
    ("sym", "code", "key"),
    [("a", "a", "a"), ("question", "", "?"), ("Left", "\0", "Left"), ("KP_Enter", "\r", "Return")],
)
def test_keys_have_one_name(sym: str, code: str, key: str) -> None:
    window, interactor = made()
    interactor.sym, interactor.code = sym, code
    assert window.pressed_key() == key
