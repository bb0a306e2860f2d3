"""`resfit fit --view`: a window that follows the fit."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from resfit.cli.progress import STAGES

if TYPE_CHECKING:
    from resfit.fitter.progress import Progress
    from resfit.result.fit_result import FitResult


class Watcher:
    """Nobody watches; the other one adds to it."""

    def show(self, progress: Progress) -> None:
        """A stage begins."""

    def finish(self, result: FitResult) -> None:
        """Show the result until the window is closed."""


class WindowWatcher(Watcher):
    """Shows the fit in a window."""

    def __init__(self, mesh: Path, family: str) -> None:
        from resfit.exports.facts import up_axis
        from resfit.viewer.playback.fit_window_client import LiveView

        self.live = LiveView(mesh, family, up_axis(mesh.name))

    def show(self, progress: Progress) -> None:
        """Show the stage and the parts of the moment."""
        stage = STAGES.get(progress.stage, progress.stage)
        self.live.show(
            stage, progress.round, progress.rounds, progress.rows, progress.iou, progress.objective
        )

    def finish(self, result: FitResult) -> None:
        """Show the result until the window is closed."""
        self.live.finish(result.assembly, float(result.metrics["iou"]), result.status.value)


@contextmanager
def watching(mesh: Path, wanted: bool, family: str) -> Iterator[Watcher]:
    """A window for a fit, if one is wanted; closed with the block if it is still open.

    Args:
        mesh: that is fitted.
        wanted: whether to open a window.
        family: of primitives.

    Raises:
        DisplayError: before the block begins, if no window can be opened.
    """
    if not wanted:
        yield Watcher()
        return
    from resfit.viewer.playback.fit_window_client import require_screen

    require_screen()
    watcher = WindowWatcher(mesh, family)
    try:
        yield watcher
    finally:
        watcher.live.close()
