"""Progress display of a fit on stderr: a bar for people, JSON lines for programs, or not at all."""

from __future__ import annotations

import json
import sys
import time
from typing import TYPE_CHECKING, Any, Literal, Self

if TYPE_CHECKING:
    from resfit.fitter.progress import Progress

ProgressMode = Literal["auto", "json", "none"]

SURE_SHARE = 0.12
"""Share of the work after which the time left is said: before, one slow stage would promise hours."""

WRITING_SHARE = 0.95
"""Share of the work that is done when the files are written. Rounds that were not needed count as done then."""

STAGES = {
    "load": "reading the mesh",
    "solid": "deciding the solid",
    "grid": "measuring distances",
    "samples": "sampling",
    "decompose": "decomposing",
    "propose": "proposing parts",
    "select": "choosing parts",
    "refine": "refining",
    "prune": "pruning",
    "finish": "finishing",
    "parts": "fitting the mesh's parts",
    "reduce": "doing with fewer parts",
    "curve": "finding the trade-off",
    "snap": "making it regular",
}
"""What people are told; a stage that is not here goes by its own name."""


class Reporter:
    """Shows nothing. Used in a `with` block; the other reporters add to it."""

    def __enter__(self) -> Self:
        """Begin to count the time."""
        self.begin = time.perf_counter()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the terminal as it was."""

    def show(self, progress: Progress) -> None:
        """A stage begins."""

    def tell(self, event: str, **values: Any) -> None:
        """Something else happened: start, stopping, writing, done."""

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.perf_counter() - self.begin

    def left(self, fraction: float) -> float | None:
        """A guess of the seconds left; None where any guess would be idle."""
        return self.elapsed * (1.0 / fraction - 1.0) if fraction >= SURE_SHARE else None


class JsonReporter(Reporter):
    """One JSON object a line: `event` says what happened, `elapsed_s` when."""

    def show(self, progress: Progress) -> None:
        """A line with all that is known about the progress."""
        left = self.left(progress.fraction)
        self.tell(
            "progress",
            stage=progress.stage,
            round=progress.round,
            rounds=progress.rounds,
            primitive_count=progress.primitive_count,
            objective=round(progress.objective, 6),
            iou=round(progress.iou, 6),
            fraction=round(progress.fraction, 4),
            left_s=None if left is None else round(left, 1),
        )

    def tell(self, event: str, **values: Any) -> None:
        """A line with the event's values."""
        line = json.dumps({"event": event, "elapsed_s": round(self.elapsed, 3), **values})
        sys.stderr.write(f"{line}\n")
        sys.stderr.flush()


class BarReporter(Reporter):
    """A progress bar with the stage, the parts so far, their IoU and the time left."""

    def __enter__(self) -> Self:
        """Start the bar."""
        from rich.console import Console
        from rich.progress import BarColumn, SpinnerColumn, TextColumn
        from rich.progress import Progress as Bar

        self.bar = Bar(
            SpinnerColumn(),
            TextColumn("{task.description:<20}"),
            BarColumn(bar_width=None),
            TextColumn("{task.percentage:>3.0f} %"),
            TextColumn("{task.fields[found]}"),
            TextColumn("{task.fields[left]}"),
            console=Console(stderr=True),
            transient=True,
        )
        self.task = self.bar.add_task("starting", total=1.0, found="", left="")
        self.bar.start()
        return super().__enter__()

    def __exit__(self, *_: object) -> None:
        """Remove the bar."""
        self.bar.stop()

    def show(self, progress: Progress) -> None:
        """Move the bar on."""
        left, found = self.left(progress.fraction), ""
        if progress.primitive_count:
            parts = "part" if progress.primitive_count == 1 else "parts"
            found = f"{progress.primitive_count} {parts}, IoU {progress.iou:.3f}"
        self.bar.update(
            self.task,
            completed=progress.fraction,
            description=STAGES.get(progress.stage, progress.stage),
            found=found,
            left="" if left is None else f"{left:.0f} s left",
        )

    def tell(self, event: str, **_: Any) -> None:
        """Events other than stages are told in the place of the stage."""
        words = {"stopping": "stopping", "writing": "writing files"}
        if event in words:
            self.bar.update(self.task, description=words[event], left="")
        if event == "writing":
            self.bar.update(self.task, completed=WRITING_SHARE)


def make_reporter(mode: ProgressMode) -> Reporter:
    """The reporter for a mode; `auto` is a bar where stderr is a terminal, and nothing elsewhere."""
    if mode == "json":
        return JsonReporter()
    return BarReporter() if mode == "auto" and sys.stderr.isatty() else Reporter()
