"""Pointer and key events on the picture: as in the desktop window, from those that its page sends."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from ..model.commands import find_command
from ..scene.controller import Controller
from .picture import Picture
from .state import is_offered

CLICK = 4.0
"""Pixels that the mouse may move in a click."""

WHEEL = 0.12
"""Natural logarithm of the distance's change for one notch of the wheel."""

LOOK = "look"
"""Slot of what only changes from where things are seen."""

KEYS = {"Backspace": "BackSpace", "Enter": "Return"}
"""Names that browsers and the controller do not share."""


class Pointer:
    """Turns events into movements of the camera, picks and commands."""

    def __init__(self, controller: Controller, picture: Picture, post: Callable[..., None]) -> None:
        """Move a controller's camera.

        Args:
            controller: whose.
            picture: where the events happen.
            post: takes what is to be done before the next picture, and a slot as `App.post` does.
        """
        self.controller = controller
        self.picture = picture
        self.post = post
        self._button = ""
        self._last = (0.0, 0.0)
        self._moved = 0.0
        self._pinch = 1.0

    def handle(self, event: Mapping[str, Any]) -> None:
        """Do what an event stands for; those that are unknown or broken do nothing."""
        kind = str(event.get("type", ""))
        try:
            if kind.endswith("ButtonPress"):
                self._button, self._moved = kind.removesuffix("ButtonPress"), 0.0
                self._last = float(event["x"]), float(event["y"])
            elif kind == "MouseMove" and self._button:
                self._move(float(event["x"]), float(event["y"]), bool(event.get("shiftKey")))
            elif kind.endswith("ButtonRelease"):
                self._release(float(event["x"]), float(event["y"]))
            elif kind == "MouseWheel":
                self._zoom(math.exp(WHEEL * max(-3.0, min(3.0, float(event["spinY"])))))
            elif kind in ("StartPinch", "Pinch"):
                self._pinched(float(event["factor"]), begins=kind == "StartPinch")
            elif kind == "keyDown":
                self._key(event)
        except (KeyError, TypeError, ValueError):
            return

    def _move(self, x: float, y: float, shift: bool) -> None:
        across, up = x - self._last[0], y - self._last[1]
        self._moved += abs(across) + abs(up)
        if self._moved < CLICK:
            return
        self._last = x, y
        camera = self.controller.scene.camera
        if self._button == "Left" and not shift:
            camera.orbit(across, up)
        else:
            camera.pan(across, up, self.picture.height)
        self.post(lambda: None, LOOK)

    def _release(self, x: float, y: float) -> None:
        button, self._button = self._button, ""
        if button == "Left" and self._moved < CLICK:
            scale = self.picture.scale
            self.post(lambda: self.controller.pick(x * scale, y * scale))
        else:
            self.post(lambda: None, LOOK)

    def _zoom(self, factor: float) -> None:
        self.controller.scene.camera.zoom(factor)
        self.post(lambda: None, LOOK)

    def _pinched(self, factor: float, begins: bool) -> None:
        before, self._pinch = (factor if begins else self._pinch), max(factor, 1e-3)
        self._zoom(max(before, 1e-3) / self._pinch)

    def _key(self, event: Mapping[str, Any]) -> None:
        key = KEYS.get(str(event["key"]), str(event["key"]))
        if event.get("controlKey"):
            key = f"ctrl+{key.upper() if event.get('shiftKey') else key.lower()}"
        command = find_command(key)
        if command is not None and is_offered(command.name):
            self.post(lambda: self.controller.run(command.name))
