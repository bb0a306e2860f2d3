"""`resfit fit` of one mesh: the fit with its progress, its folder and its summary."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from resfit.cli.browser import open_in_browser
from resfit.cli.failures import STOPPED
from resfit.cli.inputs import check_mesh
from resfit.cli.progress import ProgressMode, Reporter, make_reporter
from resfit.cli.stop import Stop, catching_signals
from resfit.cli.terminal import printable, summarise, tell
from resfit.cli.watching import Watcher, watching
from resfit.clock import Clock
from resfit.fitter.config import FitConfig
from resfit.result.folder import OURS, PARETO, check_folder, holds_fit
from resfit.shape.background_load import reading

if TYPE_CHECKING:
    from resfit.fitter.progress import Progress
    from resfit.result.fit_result import FitResult


def run_fit(
    mesh: Path,
    folder: Path,
    progress: ProgressMode,
    options: dict[str, Any],
    view: bool = False,
    open_page: bool = False,
    quiet: bool = False,
) -> int:
    """Fit, write and sum up; returns the exit code.

    Args:
        mesh: the file.
        folder: where the fit goes.
        progress: how to show it.
        options: keywords of `resfit.api.fit`.
        view: whether to show it in a window, which then stays open with the result.
        open_page: whether to open its page in a browser afterwards.
        quiet: whether to leave out the summary.

    Raises:
        InputError: before the work begins, if the mesh, an option or the folder cannot be used.
        DisplayError: before the work begins, if there is no screen for the window.
    """
    init = options.get("init")
    check_mesh(mesh)
    check_folder(
        folder, [mesh] if init is None else [mesh, init / "assembly.json" if init.is_dir() else init]
    )
    with watching(mesh, view, options.get("primitive") or FitConfig.primitive) as watcher:
        with catching_signals() as stop:
            code, result = fit_and_write(
                mesh, folder, progress, options, stop, Clock.of_process(), quiet, watcher
            )
        if open_page and not result.placeholder:
            open_in_browser(folder / "viewer.html")
        # Ctrl-C ends the process again from here on; what is written stays.
        watcher.finish(result)
    return code


def fit_and_write(
    mesh: Path,
    folder: Path,
    progress: ProgressMode,
    options: dict[str, Any],
    stop: Stop,
    clock: Clock,
    quiet: bool,
    watcher: Watcher,
) -> tuple[int, FitResult]:
    """The same as `run_fit`, without its checks; the exit code and the result, of which a placeholder is not written.

    Raises:
        InputError: if the mesh, an option or the folder cannot be used.
        StoppedError: if it was stopped before the mesh was read.
    """
    with reading(mesh) as source, make_reporter(progress) as reporter:
        reporter.tell("start", mesh=mesh.name, preset=options.get("preset") or FitConfig.preset)
        from resfit import fit as fit_mesh

        def show(stage: Progress) -> None:
            reporter.show(stage)
            watcher.show(stage)

        should_stop = _told_once(stop, reporter)
        result = fit_mesh(source, None, show, should_stop=should_stop, clock=clock, **options)
        code = STOPPED if result.status.stopped_early or stop.requested else 0
        # A box around the mesh is no fit.
        written = None if result.placeholder else str(folder)
        if written:
            reporter.tell("writing")
            result.save(folder)
        reporter.tell("done", status=result.status.name.lower(), exit_code=code, directory=written)
    if not written:
        kept = f"; the earlier fit in '{folder}' is as it was" if holds_fit(folder) else ""
        tell(f"resfit: stopped before a part was found, so nothing was written{kept}.")
    elif not quiet:
        summarise(summary(result, folder, clock.wall_s))
    return code, result


def _told_once(stop: Stop, reporter: Reporter) -> Any:
    """`stop`, which tells the reporter when it is first found to be wanted."""
    told = False

    def should_stop() -> bool:
        nonlocal told
        if stop.requested and not told:
            told = True
            reporter.tell("stopping")
        return stop.requested

    return should_stop


def summary(result: FitResult, folder: Path, seconds: float) -> str:
    """Summary of a fit in a few lines: what people want to know first.

    Args:
        result: of the fit.
        folder: where it was written.
        seconds: that all of it took.
    """
    from resfit.assembly.transform import NORMALISED_SIDE

    count, iou = result.metrics["primitive_count"], result.metrics["iou"]
    parts = f"{count} part{'' if count == 1 else 's'}"
    distance = "no surface"
    if result.deviation is not None:
        share = result.deviation.p95 / (NORMALISED_SIDE * result.assembly.transform.scale)
        distance = (
            f"95 % of the surface within {result.deviation.p95:.3g} units ({100.0 * share:.2g} % of the size)"
        )
    # A thick shell round an open sheet is easy to match: there the distance says more.
    figures = (
        [f"IoU {iou:.3f}", distance] if result.input.closed else [distance, f"IoU {iou:.3f} of the solid"]
    )
    lines = [
        f"{result.input.name}: {parts}, {', '.join(figures)}, {seconds:.1f} s",
        f"  input    {result.input.sentence}",
        *(f"           {note}" for note in result.input.notes),
        *(f"  parts    {note}" for note in result.notes),
        *left_out_line(result),
        f"  stopped  {result.status.value}",
        *chamfer_line(result),
        *([f"  snapped  {result.snapped}"] if result.snapped else []),
        f"  written  {folder}/ {' '.join(name for name in (*OURS, *PARETO) if (folder / name).exists())}",
        f"  look at  {folder / 'preview.png'}, or call: resfit view {shlex.quote(str(folder))}",
    ]
    return "\n".join(map(printable, lines)) + "\n"


def left_out_line(result: FitResult) -> list[str]:
    """Warning of what the assembly is known not to show of the input; nothing where that is nothing."""
    holes = result.metrics.get("filled_holes", 0)
    if not holes:
        return []
    what = "1 through-hole of the input is" if holes == 1 else f"{holes} through-holes of the input are"
    return [f"  left out {what} not in the result"]


def chamfer_line(result: FitResult) -> list[str]:
    """The Chamfer distance before and after, where parts were moved to lessen it; else nothing."""
    if "chamfer" not in result.objective:
        return []
    before, after = result.objective["chamfer_before"], result.objective["chamfer"]
    return [
        f"  chamfer  {before:.4g} before, {after:.4g} now (100 x mean squared distance; longest side 1.8)"
    ]
