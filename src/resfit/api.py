"""The facade: what scripts and the command line call."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Unpack

import numpy as np
import warp as wp

from resfit.assembly.change_of_frame import rows_in_frame
from resfit.assembly.transform import Transform
from resfit.clock import Clock, timed
from resfit.errors import InputError
from resfit.exports.by_suffix import export_assembly as export
from resfit.fitter.config import OPTIONS, FitConfig, FitOptions, preset_config
from resfit.fitter.progress import TARGET_SHARE, Progress
from resfit.kernels.prefetch import prefetch
from resfit.kernels.runtime import launch, module_loading
from resfit.loading import load_behind, without_collector
from resfit.shape.background_load import MeshReader, reading

if TYPE_CHECKING:
    import trimesh

    from resfit.assembly.assembly import Assembly
    from resfit.eval.metrics.evaluate import Align
    from resfit.result.fit_result import FitResult
    from resfit.shape.target import Target

__all__ = ["FitConfig", "Progress", "evaluate", "export", "fit"]

READING_SECONDS = 10.0
"""However little time is allowed, a mesh may take so long to be read: there is nothing to write before."""

TARGET_STAGES = ("load", "solid", "grid", "samples")


def fit(
    mesh_or_path: str | os.PathLike[str] | trimesh.Trimesh | trimesh.Scene,
    config: FitConfig | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    *,
    preset: str | None = None,
    should_stop: Callable[[], bool] | None = None,
    init: Assembly | str | os.PathLike[str] | None = None,
    objective: Literal["volume", "chamfer"] | None = None,
    clock: Clock | None = None,
    **options: Unpack[FitOptions],
) -> FitResult:
    """Fit an assembly of primitives to a mesh.

    Args:
        mesh_or_path: path of a mesh file, or a trimesh object.
        config: all options; those of `preset` unless given.
        on_progress: called at the beginning of each stage.
        preset: fast, balanced (unless told otherwise) or best.
        should_stop: asked often; once True, the best so far is returned. With it or a timeout, another process
            reads the file.
        init: an assembly to start from, a path of one, or the folder of a fit.
        objective: volume, unless given: rounds of fitting. chamfer only moves the parts of `init`, which may be of any
            families, to lessen the Chamfer distance between the surfaces.
        clock: what `cpu_s` and `wall_s` count from; this call, unless given.
        options: fields of the configuration to change.

    Raises:
        InputError: if the mesh cannot be read or holds nothing solid, or an option makes no sense.
        StoppedError: if it was stopped before the mesh was read.
    """
    clock = clock or Clock.now()
    config = make_config(config, preset, dict(options))
    start = None if init is None else load_init(init)
    check_objective(objective, start, config)
    begin, compiled = Clock.now(), module_loading.compile_seconds
    device = launch.choose_device(config.device)
    prefetch(config.primitive, device)
    timings: dict[str, float] = {}
    tell = on_progress or (lambda progress: None)
    with (
        without_collector(),
        launch.often_switching(),
        _stoppable(mesh_or_path, should_stop, config.timeout, begin) as source,
    ):
        target = _measure(source, config, device, tell, clock, timings)
        # There by now, or nearly: `_measure` had them loaded in the background.
        from resfit.fitter.pipeline import fit_stages
        from resfit.result.additions import add_stages
        from resfit.result.measure import measure_outcome
    limited = config
    if config.timeout:
        # It counts from the call, not from the first round; once it is over, not even one is begun.
        limited = replace(config, timeout=max(1e-9, config.timeout - begin.wall_s))
    if start is not None and objective == "chamfer":
        from resfit.result.moving import move_parts

        return move_parts(
            start, target, config, limited.timeout, mesh_or_path, tell, should_stop, clock, timings
        )
    fitted = fit_stages(
        target,
        limited,
        device,
        lambda progress: tell(progress.after_target()),
        should_stop or (lambda: False),
        None if start is None else start_rows(start, config.primitive, target.transform),
    )
    outcome = fitted.outcome
    timings |= outcome.timings
    timings["compile"] = module_loading.compile_seconds - compiled
    name = mesh_or_path if isinstance(mesh_or_path, str | os.PathLike) else None
    result = measure_outcome(outcome, target, config, name=name, start=start, clock=clock, timings=timings)
    return add_stages(result, fitted, target, config)


def evaluate(
    prediction: Any,
    target: Any,
    *,
    align: Align = "none",
    emd: bool = True,
    features: Any = None,
    device: str = "auto",
) -> dict[str, Any]:
    """Score a reconstruction of a mesh by the metrics that papers and peers report.

    Args:
        prediction: what `fit` returned, an Assembly, the path of an assembly.json or of a fit's folder, or the parts of
            any other tool as a mesh file, a trimesh mesh or scene, or a sequence of meshes, in the target's own frame.
        target: the mesh: a path or a trimesh object.
        align: `bbox` moves the prediction's box onto the target's, in the same proportions.
        emd: whether to compute the earth mover's distance, which takes about as long as the rest.
        features: where features for IntraPrim and InterPrim come from: points (n, 3) and features (n, d), a function of
            a mesh's path and points, the name of an installed source, or a command with {mesh} {points} {out}.
        device: `auto` (the CPU), `cpu`, `cuda:0`.

    Returns:
        iou, bisurf_iou, bisurf_iou_005, cd, cd_floor, emd, primitive_count, overlap, unoverlap, intra_prim, inter_prim,
        floats, surface_mean, surface_p95, surface_max, closed, target_kind, target_rule, notes. Measured in the
        target's normalised frame (longest side 1.8); shares are in 0..1; None where there is nothing to measure.

    Raises:
        InputError: if something cannot be read.
    """
    with without_collector():
        from resfit.eval.metrics.evaluate import evaluate as evaluate_prediction

    prediction = getattr(prediction, "assembly", prediction)
    return evaluate_prediction(prediction, target, align=align, emd=emd, features=features, device=device)


def check_objective(objective: str | None, start: Assembly | None, config: FitConfig) -> None:
    """Refuse an objective that does not exist, lacks the assembly that it needs, or does not go with other options.

    Raises:
        InputError: if so.
    """
    if objective not in (None, "volume", "chamfer"):
        raise InputError(f"--objective {objective}: there is no such objective; choose volume or chamfer.")
    if objective == "chamfer" and (start is None or not start.primitives):
        raise InputError(
            "--objective chamfer moves the parts of an assembly; give one that has parts with --init."
        )
    idle = [name for name, entry in config.changed() if not entry.moves]
    if objective == "chamfer" and idle:
        needs = "needs" if len(idle) == 1 else "need"
        raise InputError(
            f"--objective chamfer only moves parts; {' and '.join(idle)} {needs} a fit without it."
        )
    if start is not None and config.per_part == "on":
        raise InputError("--per-part fits each part anew; it cannot go on from the assembly of --init.")


def make_config(config: FitConfig | None, preset: str | None, options: dict[str, Any]) -> FitConfig:
    """The configuration that `fit` was asked for; options that are None change nothing.

    Raises:
        InputError: for an unknown option or preset, a value out of range, an option without effect, or a
            configuration and a preset at once.
    """
    for name in options:
        if name not in OPTIONS:
            raise InputError(f"there is no option {name}; the options are {', '.join(sorted(OPTIONS))}.")
    if config is not None and preset is not None:
        raise InputError("give a preset or a config, not both.")
    if config is None:
        made = preset_config(preset or FitConfig.preset, **options)
    else:
        made = replace(config, **{name: value for name, value in options.items() if value is not None})
    made.check_effect()
    return made


def load_init(init: Assembly | str | os.PathLike[str]) -> Assembly:
    """The assembly to start from; a folder stands for the assembly.json in it.

    Raises:
        InputError: if it cannot be read.
    """
    with without_collector():
        from resfit.assembly.assembly import Assembly

    if isinstance(init, Assembly):
        return init
    path = Path(init)
    return Assembly.load(path / "assembly.json" if path.is_dir() else path)


def start_rows(assembly: Assembly, primitive: str, transform: Transform) -> np.ndarray:
    """Rows (k, ROW) float32 of an assembly in the normalised frame of `transform`.

    Raises:
        InputError: if a part is of another family than `primitive`.
    """
    for part in assembly.primitives:
        if part.family != primitive:
            raise InputError(
                f"{part.name} of the assembly to start from is a {part.family}, but {primitive} is fitted;"
                f" use --primitive {part.family} or another assembly."
            )
    return rows_in_frame(assembly, transform)


def _stoppable(
    source: Any, should_stop: Callable[[], bool] | None, timeout: float, begin: Clock
) -> AbstractContextManager[Any]:
    """`source`, whose reading ends where it is to stop: that takes a process of its own."""
    if should_stop is None and not timeout and not isinstance(source, MeshReader):
        return nullcontext(source)

    def stop() -> bool:
        late = timeout > 0.0 and begin.wall_s > max(timeout, READING_SECONDS)
        return late or (should_stop is not None and should_stop())

    return reading(source, stop)


def _measure(
    source: Any,
    config: FitConfig,
    device: wp.Device,
    tell: Callable[[Progress], None],
    clock: Clock,
    timings: dict[str, float],
) -> Target:
    """The target of a mesh, timed as one stage; `start` is what came before.

    Its modules, with trimesh and SciPy, are loaded only here, while the kernels load: that takes no interpreter. Nor
    does much of the measuring: the modules of what comes after it are loaded meanwhile.
    """
    from resfit.shape.target import make_target

    load_behind("scipy.spatial", "resfit.result.additions", "resfit.result.measure")

    def begin(stage: str) -> None:
        done = TARGET_STAGES.index(stage) / len(TARGET_STAGES) if stage in TARGET_STAGES else 0.0
        tell(Progress(stage, 0, config.rounds, 0, 0.0, 0.0, TARGET_SHARE * done))

    timings["start"] = clock.wall_s
    with timed(timings, "target"):
        return make_target(source, device, config.resolution, config.samples, config.seed, begin)
