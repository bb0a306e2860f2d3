"""A window that follows a fit while it goes on: the window's end of it, a process of its own.

Lines of JSON come on standard input: `begin` (mesh, title, family, up), `step` (stage, round, rounds, rows, iou,
objective) at every stage, and `final` (assembly, iou, status). Without a final one the window closes with the fit.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from resfit.errors import ResfitError

from ...assembly.assembly import Assembly
from ...assembly.colors import palette_color
from ...assembly.primitive import Primitive
from ...kernels.rows import ROW
from ..model.comparison import Comparison
from ..model.view_options import View
from ..scene.camera import OrbitCamera
from ..scene.plotter import make_plotter
from .playback import Frame, figures, final_frame, matches
from .playback_scene import StepScene
from .player import SIZE, Player


class LiveSteps:
    """Makes steps of what a fit sends; parts that stay much the same keep their names and colours."""

    def __init__(self, family: str) -> None:
        """Begin with no parts; rows are of `family`."""
        self.family = family
        self.assembly = Assembly()
        self._count = 0
        self._rounds = 0

    def step(self, values: Mapping[str, Any]) -> Frame:
        """The step of one event.

        Raises:
            AssemblyError: if it holds parts that cannot be.
        """
        if values["event"] == "final":
            frame = final_frame(
                Assembly.from_json(values["assembly"].encode()), max(1, self._rounds), values["iou"]
            )
            return replace(frame, detail=f"{frame.detail} · {values['status']}")
        if values["rows"] is not None:
            self._take(np.asarray(values["rows"], np.float32).reshape(-1, ROW))
        self._rounds, count = int(values["round"]), len(self.assembly.primitives)
        title = f"Round {values['round']} of {values['rounds']} · " if values["round"] else ""
        detail = (
            figures(count, values["iou"] or None, values["objective"] or None) if count else "nothing yet"
        )
        return Frame("live", self._rounds, f"{title}{values['stage']}", detail, self.assembly)

    def _take(self, rows: np.ndarray) -> None:
        before = self.assembly.rows()
        if before.shape == rows.shape and np.array_equal(before, rows):
            return
        same = {new: self.assembly.primitives[old] for new, old in matches(rows, before, self.family)[0]}
        parts = []
        for index, row in enumerate(rows):
            if index in same:
                name, color = same[index].name, same[index].color
            else:
                name, color = f"step_{self._count:04d}", palette_color(self._count)
                self._count += 1
            parts.append(Primitive.from_row(self.family, name, row, color))
        self.assembly = Assembly(tuple(parts))


def follow(player: Player, steps: LiveSteps, events: queue.SimpleQueue[dict[str, Any] | None]) -> None:
    """Add what has come since the last time; where nothing more will come and there is no result, close."""
    while not events.empty():
        values = events.get()
        if values is None:
            player.closing = player.frames[-1].stage != "final"
            return
        frame = steps.step(values)
        scene = player.scene.scene
        if frame.assembly.primitives and not player.frames[-1].assembly.primitives:
            # The mesh stood in for them.
            scene.view = replace(scene.view, mesh="off")
        player.add(frame)


def make_player(values: Mapping[str, Any], off_screen: bool = False) -> Player:
    """The window, with the mesh in it."""
    comparison, assembly = None, Assembly()
    # What is wrong with a mesh is said by the fit.
    with suppress(ResfitError):
        comparison = Comparison(Path(values["mesh"]), "cpu")
        assembly = Assembly(transform=comparison.transform)
    plotter = make_plotter(SIZE, off_screen, title=f"resfit · {values['title']}")
    view = View(mesh="ghost" if comparison else "off")
    scene = StepScene(plotter, assembly, comparison, view, OrbitCamera(values["up"]), "cpu")
    return Player(plotter, scene, [Frame("begin", 0, values["title"], "the fit begins", assembly)])


def main() -> None:
    """Follow what comes on standard input until the window is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "nice"):
        # The fit goes first where cores are few.
        os.nice(5)
    events: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
    begin = json.loads(sys.stdin.readline())
    steps = LiveSteps(begin["family"])

    def read(lines: Iterable[str]) -> None:
        for line in lines:
            events.put(json.loads(line))
        events.put(None)

    # Else the fit's pipe would fill up while something is drawn.
    threading.Thread(target=read, args=(sys.stdin,), daemon=True).start()
    player = make_player(begin)
    player.on_tick = lambda: follow(player, steps, events)
    player.run()


if __name__ == "__main__":
    main()
