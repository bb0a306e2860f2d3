"""A fixed sequence of launches that is made once and repeated: arguments are packed the first time only.

On a GPU the sequence is a captured graph. On the CPU packing the arguments of a launch takes Python longer than many
launches take to run, and holds the interpreter lock.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import warp as wp

from .launch import recorded


class LaunchGraph:
    """Calls `body` once, and from then on repeats the launches that it made.

    Args:
        body: makes launches by `launch` and touches arrays in no other way; their arguments are the same every time,
            but for counts given as functions, which are asked each time on the CPU.
        device: of the launches. The kernels must be loaded where it is a GPU: nothing may be loaded during a capture.
        capture: whether a GPU may capture them; not so if counts change.
    """

    def __init__(self, body: Callable[[], None], device: wp.Device, capture: bool = True):
        self.body, self.device, self.capture = body, device, capture
        self.graph: Any = None
        self.commands: list[Callable[[], None]] | None = None

    def __call__(self) -> None:
        """Run the sequence."""
        if self.device.is_cuda and self.capture:
            self._run_graph()
        elif self.device.is_cuda:
            self.body()
        elif self.commands is None:
            with recorded() as commands:
                self.body()
            self.commands = commands
        else:
            for command in self.commands:
                command()

    def _run_graph(self) -> None:
        if self.graph is None:
            with wp.ScopedCapture(self.device) as capture:
                self.body()
            self.graph = capture.graph
        wp.capture_launch(self.graph)
