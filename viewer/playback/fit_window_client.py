"""A window that follows a fit while it goes on: the fit's end of it.

The window is another process, fed through a pipe: whatever becomes of it, the fit goes on undisturbed, and Ctrl-C
reaches the fit alone. `live_window.py` is the other end. Nothing here loads VTK.
"""

from __future__ import annotations

import json
import queue
import subprocess
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from resfit.children import python_command

from ...assembly.assembly import Assembly
from ..scene.opengl_check import DisplayError, has_display, probe_rendering, require

PATIENCE = 5.0
"""Seconds that a window gets to close when it is told to."""


def require_screen() -> None:
    """Refuse to go on where no window can be opened.

    Raises:
        DisplayError: one sentence that says what to do instead.
    """
    if not has_display():
        raise DisplayError(
            "there is no screen to show the fit on; leave --view out, and make a film of the fit afterwards"
            " with resfit view DIR --video fit.mp4."
        )
    require(probe_rendering(off_screen=False))


def window_command() -> list[str]:
    """Command line of the window's process."""
    return python_command("-m", "resfit.viewer.playback.fit_window")


class LiveView:
    """The fit's end of the window.

    Attributes:
        closed: whether the window is gone; nothing is sent then.
    """

    def __init__(self, mesh: Path, family: str, up: str) -> None:
        """Open the window.

        Args:
            mesh: that is fitted; shown until there are parts.
            family: of the rows that will come.
            up: which axis points up, y or z.
        """
        self.closed = False
        # A session of its own: Ctrl-C in the terminal is for the fit.
        self._process = subprocess.Popen(
            window_command(), stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, start_new_session=True
        )
        self._lines: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        # The pipe may be full while the window is busy: the fit does not wait for that.
        self._writer = threading.Thread(target=self._write, name="resfit-view", daemon=True)
        self._writer.start()
        self._send(event="begin", mesh=str(mesh.absolute()), title=mesh.name, family=family, up=up)

    def show(
        self,
        stage: str,
        number: int,
        rounds: int,
        rows: np.ndarray | None,
        iou: float,
        objective: float,
    ) -> None:
        """Show where the fit is; returns at once.

        Args:
            stage: in words.
            number, rounds: the round, and how many are allowed.
            rows: (k, ROW) float32, normalised frame; None leaves the parts as they are.
            iou, objective: of these rows.
        """
        listed = None if rows is None else np.asarray(rows, np.float32).tolist()
        self._send(
            event="step", stage=stage, round=number, rounds=rounds, rows=listed, iou=iou, objective=objective
        )

    def finish(self, assembly: Assembly, iou: float, says: str) -> None:
        """Show the result, and wait until the window is closed; Ctrl-C closes it."""
        self._send(event="final", assembly=assembly.to_json().decode(), iou=iou, status=says)
        self._lines.put(None)
        try:
            self._process.wait()
        except KeyboardInterrupt:
            self.close()

    def close(self) -> None:
        """Close the window; also where it is closed already."""
        self.closed = True
        self._lines.put(None)
        self._process.terminate()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._writer.join(PATIENCE)

    def _send(self, **values: Any) -> None:
        if not self.closed:
            self._lines.put(json.dumps(values).encode() + b"\n")

    def _write(self) -> None:
        pipe = self._process.stdin
        assert pipe is not None
        try:
            while (line := self._lines.get()) is not None:
                pipe.write(line)
                pipe.flush()
        except (OSError, ValueError):
            self.closed = True
        finally:
            with suppress(OSError):
                pipe.close()
