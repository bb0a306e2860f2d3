"""`resfit.fit` with the objective chamfer: the parts of an assembly are moved, and nothing else."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from resfit.clock import Clock

from ..assembly.assembly import Assembly
from ..assembly.change_of_frame import rows_in_frame
from ..fitter.config import FitConfig
from ..fitter.progress import Progress
from ..fitter.refine.chamfer import move_assembly
from ..kernels.runtime import launch, module_loading
from ..shape.target import Target
from .fit_result import FitResult
from .measure import measure_outcome


def move_parts(
    start: Assembly,
    target: Target,
    config: FitConfig,
    timeout: float,
    source: Any,
    tell: Callable[[Progress], None],
    should_stop: Callable[[], bool] | None,
    clock: Clock,
    timings: dict[str, float],
) -> FitResult:
    """The result of `fit` with the objective chamfer; its `objective` has the distance before and after."""
    families = [part.family for part in start.primitives]
    rows, compiled = rows_in_frame(start, target.transform), module_loading.compile_seconds

    def show(share: float) -> None:
        tell(Progress("chamfer", 1, 1, len(rows), 0.0, 0.0, share).after_target())

    outcome, moved = move_assembly(
        target,
        rows,
        families,
        launch.choose_device(config.device),
        config.parsimony,
        timeout,
        should_stop or (lambda: False),
        show,
    )
    timings |= outcome.timings | {"compile": module_loading.compile_seconds - compiled}
    name = source if isinstance(source, str | os.PathLike) else None
    result = measure_outcome(outcome, target, config, name=name, start=start, clock=clock, timings=timings)
    options = {**result.options, "objective": "chamfer"}
    parts = tuple(
        replace(part, name=old.name, color=old.color)
        for part, old in zip(result.assembly.primitives, start.primitives, strict=True)
    )
    provenance = replace(result.assembly.provenance, options=options)
    assembly = replace(result.assembly, primitives=parts, provenance=provenance)
    distances = {"chamfer_before": moved.before, "chamfer": moved.after} if np.isfinite(moved.before) else {}
    return replace(result, assembly=assembly, objective=result.objective | distances, options=options)
