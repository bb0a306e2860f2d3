"""Additions of a fit's stages to its result: names of the mesh's parts, relations, notes, trade-off curve."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from resfit.clock import timed

from ..fitter.config import FitConfig
from ..fitter.pipeline import Fitted
from ..fitter.regularise.relations import sum_up
from ..shape.target import Target
from .fit_result import FitResult
from .pareto import measure_curve


def add_stages(result: FitResult, fitted: Fitted, target: Target, config: FitConfig) -> FitResult:
    """The result with what the stages found.

    Args:
        result: measured, its parts named by their place.
        fitted: what the fitter returned.
        target: what was fitted.
        config: the options.
    """
    assembly = result.assembly
    if fitted.names is not None and not result.placeholder:
        assembly = assembly.renamed(fitted.names)
    names = [part.name for part in assembly.primitives]
    relations = tuple(relation.describe(names) for relation in fitted.relations)
    curve, timings = None, dict(result.timings)
    if fitted.curve:
        with timed(timings, "curve"):
            curve = measure_curve(fitted.curve, target, config, assembly)
    notes = list(fitted.notes)
    said: dict[str, Any] = {}
    if fitted.snapped:
        said["snapped"] = sum_up(fitted.relations) or "nothing: no relation was near enough"
    return replace(
        result,
        assembly=assembly,
        relations=relations,
        notes=tuple(notes),
        curve=curve,
        timings=timings,
        **said,
    )
