"""`resfit fit`: meshes as assemblies of primitives, each in a folder."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Group, Parameter

from resfit.cli.browser import open_in_browser
from resfit.cli.failures import STOPPED
from resfit.cli.inputs import check_mesh
from resfit.cli.progress import ProgressMode, Reporter, make_reporter
from resfit.cli.stop import Stop, catching_signals
from resfit.cli.terminal import printable, summarise, tell
from resfit.cli.watching import Watcher, watching
from resfit.clock import Clock
from resfit.errors import InputError
from resfit.folder import OURS, PARETO, check_folder, default_folder, holds_fit
from resfit.target.reader import reading

if TYPE_CHECKING:
    from resfit.fitter.progress import Progress
    from resfit.result import FitResult

MORE = Group("More options", show=False)
"""Shown by --help-all only."""


def fit(
    *meshes: Annotated[Path, Parameter(required=True)],
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    preset: Literal["fast", "balanced", "best"] = "balanced",
    device: str = "auto",
    seed: int = 0,
    max_primitives: int | None = None,
    target_iou: float | None = None,
    tolerance: float | None = None,
    timeout: Annotated[float | None, Parameter(group=MORE)] = None,
    rounds: Annotated[int | None, Parameter(group=MORE)] = None,
    primitive: Annotated[str | None, Parameter(group=MORE)] = None,
    union: Annotated[Literal["smooth", "hard"] | None, Parameter(group=MORE)] = None,
    init: Annotated[Path | None, Parameter(group=MORE)] = None,
    objective: Annotated[Literal["volume", "chamfer"] | None, Parameter(group=MORE)] = None,
    decompose: Annotated[Literal["msd", "coacd"] | None, Parameter(group=MORE)] = None,
    optimizer: Annotated[Literal["levenberg", "adam"] | None, Parameter(group=MORE)] = None,
    parsimony: Annotated[float | None, Parameter(group=MORE)] = None,
    snap: Annotated[bool, Parameter(negative="")] = False,
    pareto: Annotated[bool, Parameter(negative="")] = False,
    per_part: Annotated[bool | None, Parameter(negative="--whole")] = None,
    view: Annotated[bool, Parameter(negative="")] = False,
    open_page: Annotated[bool, Parameter(name="--open", negative="")] = False,
    quiet: Annotated[bool, Parameter(name=("--quiet", "-q"), negative="")] = False,
    progress: Annotated[ProgressMode, Parameter(group=MORE)] = "auto",
) -> int:
    """Fit an assembly of primitives to each mesh, and write it to a folder.

    Ctrl-C keeps the best so far, if the mesh is read by then, and begins no other mesh; a second one aborts. More
    options: resfit fit --help-all.

    Args:
        meshes: .glb .gltf .obj .ply .stl .off .3mf, or one of them packed: .zip .tar .gz .tgz .bz2 .tbz2. Several are
            fitted one after the other.
        output: folder to write, which may hold an earlier fit; STEM.resfit in the current folder unless given. Of
            several meshes: the folder that these come to lie in.
        preset: how much work to spend. best, about three times balanced, also takes parts that bring a third as much:
            for likeness, where parts need not be few.
        device: auto (the CPU), cpu or cuda:0.
        seed: of all random choices.
        max_primitives: give the best assembly of at most so many parts; 64 unless given.
        target_iou: stop once the assembly matches the solid this well, 0 to 1.
        tolerance: stop once 95 % of the surface is nearer than this, in the mesh's units.
        timeout: seconds after which the best so far is written; a mesh may take 10 s to be read in any case.
        rounds: most rounds of fitting.
        primitive: family to fit: superfrustum (unless given), superprimitive, superquadric, cuboid.
        union: whether parts may run into each other smoothly; smooth unless given.
        init: assembly.json, or the folder of an earlier fit, to start from.
        objective: rounds of fitting to the volume (volume, unless given), or only the parts of --init moved to lessen
            the Chamfer distance between the surfaces (chamfer).
        decompose: how to cut what is unexplained: by thickness (msd, unless given) or into convex pieces (coacd).
        optimizer: second-order steps (levenberg, unless given) or the paper's Adam (adam), which fits less well.
        parsimony: what a part must add to the objective to be worth having; about 0.0026 unless given, 0.0008 with
            best.
        snap: make the result regular: symmetry, canonical shapes, equal axes, sizes and centres.
        pareto: write the best assembly of every number of parts too; the fit itself stays as it is.
        per_part: fit the mesh's nodes, or else its bodies, one by one and keep their names; --whole never does; unless
            given, that is done where it pays.
        view: open a window that shows the fit as it happens; closing it does not stop the fit.
        open_page: open the fit's viewer.html in a browser afterwards.
        quiet: no summary and no bar; errors are told.
        progress: a bar if stderr is a terminal (auto), one JSON object a line on stderr (json), or none.
    """
    options = {
        "preset": preset,
        "device": device,
        "seed": seed,
        "max_primitives": max_primitives,
        "target_iou": target_iou,
        "tolerance": tolerance,
        "timeout": timeout,
        "rounds": rounds,
        "primitive": primitive,
        "union": union,
        "init": init,
        "objective": objective,
        "decompose": decompose,
        "optimizer": optimizer,
        "parsimony": parsimony,
        "snap": snap or None,
        "pareto": pareto or None,
        "per_part": None if per_part is None else ("on" if per_part else "off"),
    }
    if tolerance is not None and not tolerance > 0.0:
        raise InputError(f"--tolerance {tolerance:g} is out of range; it must be above 0.")
    mode = "none" if quiet and progress == "auto" else progress
    if len(meshes) == 1:
        folder = output or default_folder(meshes[0])
        return run_fit(meshes[0], folder, mode, options, view, open_page, quiet)
    for name, given in {"--init": init, "--view": view, "--open": open_page}.items():
        if given:
            raise InputError(f"{name} goes with one mesh only, and {len(meshes)} are given.")
    from resfit.cli.several import fit_each

    return fit_each(meshes, output, mode, options, quiet)


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
    with watching(mesh, view, options.get("primitive") or "superfrustum") as watcher:
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
        reporter.tell("start", mesh=mesh.name, preset=options.get("preset"))
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
    """What people want to know first, in a few lines.

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
    """What of the input the assembly is known not to show; nothing where that is nothing."""
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
