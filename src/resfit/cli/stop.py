"""Ctrl-C and SIGTERM as a wish to stop: the best so far is kept. A second one aborts."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Stop:
    """Stop flag. Nothing is written where the signal arrives: it may be in the middle of another line."""

    def __init__(self) -> None:
        self.requested = False

    def __call__(self) -> bool:
        """True if the fit is to stop."""
        return self.requested

    def handle(self, number: int, frame: FrameType | None) -> None:
        """The first signal asks to stop; the next one is raised.

        Raises:
            KeyboardInterrupt: at the second signal.
        """
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True


@contextmanager
def catching_signals() -> Iterator[Stop]:
    """Catch SIGINT and SIGTERM while the block runs."""
    stop = Stop()
    if threading.current_thread() is not threading.main_thread():
        # Python delivers signals to the main thread only, and lets no other one ask for them.
        yield stop
        return
    before = {number: signal.signal(number, stop.handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
