"""`resfit view --video`: write a film, with a bar on stderr where that is a terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from resfit.cli.terminal import summarise

if TYPE_CHECKING:
    from collections.abc import Callable


def make_film(
    request: Any,
    path: Path,
    motion: Literal["optimisation", "explode", "turntable"] | None,
    seconds: float | None,
    fps: float,
) -> None:
    """Write a film and say where it is.

    Args:
        request: a `resfit.viewer.scene.request.Request`, what to show.
        path: of the film.
        motion: what moves; by what is there unless given.
        seconds: that it takes; by its motion unless given.
        fps: pictures a second.

    Raises:
        InputError: if something cannot be read or written.
        DisplayError: if nothing can be drawn here.
    """
    from resfit.viewer.playback.film import FilmRequest, save_film

    with _bar() as tell:
        made = save_film(request, FilmRequest(path, motion, seconds, fps), tell)
    summarise(f"{path}: {made}\n")


@contextmanager
def _bar() -> Iterator[Callable[[float], None]]:
    """A progress bar that is moved by shares of the work."""
    if not sys.stderr.isatty():
        yield lambda share: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = TextColumn("drawing"), BarColumn(bar_width=None), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda share: bar.update(task, completed=share)
