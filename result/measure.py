"""Measurement of a fit: what the fitter found as what `resfit.fit` returns, parts named and coloured."""

from __future__ import annotations

import hashlib
import os
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from resfit.clock import Clock, peak_mb, timed

from ..assembly.assembly import Assembly
from ..assembly.colors import palette_color
from ..assembly.history import History, HistoryRound, score_values
from ..assembly.provenance import Provenance
from ..assembly.transform import Transform
from ..eval.metrics.assembly_metrics import measure_cheap, measure_deviation
from ..fitter.config import FitConfig, preset_config
from ..fitter.objective.objective import Score, Tally
from ..fitter.objective.samples import objective_samples
from ..fitter.objective.scoring import score_values as score_rows
from ..fitter.objective.scoring import values_at
from ..fitter.outcome import Outcome
from ..kernels.field.combine import FAR, fold
from ..kernels.field.points import point_blocks
from ..kernels.primitives import family
from ..kernels.primitives.swept_solids import box_solids
from ..kernels.rows import BLEND, ROW, SHAPE, SHAPES, TRANSLATION, empty_rows
from ..kernels.runtime import launch
from ..shape.target import Target
from .fit_result import FitResult, describe_input

UNRECORDED = ("device", "timeout", "seed", "preset")
"""Options that stay out of an assembly's provenance, because it is the same without them, or has them elsewhere."""


def measure_outcome(
    outcome: Outcome,
    target: Target,
    config: FitConfig,
    *,
    name: str | os.PathLike[str] | None,
    start: Assembly | None,
    clock: Clock,
    timings: dict[str, float],
) -> FitResult:
    """Name and colour the parts, and measure the whole.

    Args:
        outcome: what the fitter found; where it was stopped before it found a part, the bounding box stands in.
        target: what was fitted.
        config: the options.
        name: path of the input, None if it came as an object.
        start: what the fit started from, if anything.
        clock: when the work began.
        timings: wall seconds of the stages so far.
    """
    rows, families = outcome.rows, outcome.families
    placeholder = not len(rows) and outcome.status.stopped_early
    if placeholder:
        rows, families = _box_rows(target, config.primitive), [config.primitive]
    options = _recorded(config, start)
    provenance = Provenance.current(seed=config.seed, options=options, input_sha256=target.input_sha256)
    colors = [palette_color(index) for index in range(len(rows))]
    assembly = Assembly.from_rows(rows, families, colors, target.transform, provenance)
    jobs = (
        lambda: measure_deviation(assembly, target, config.device),
        lambda: part_gains(rows, families, target, config),
        lambda: measure_cheap(assembly, target, config.device),
    )
    with timed(timings, "metrics"), launch.side_by_side(*jobs) as found:
        deviation, (score, gains), cheap = (future.result() for future in found)
    cost = {"cpu_s": clock.cpu_s, "wall_s": clock.wall_s, "peak_mb": peak_mb()}
    return FitResult(
        assembly=assembly,
        status=outcome.status,
        history=_history(outcome, config.primitive, target.transform),
        metrics=cheap | cost,
        timings=timings,
        input=describe_input(target, name),
        deviation=deviation,
        objective=score_values(score),
        gains=gains,
        placeholder=placeholder,
        target=target,
        options=options,
        device=launch.choose_device(config.device).alias,
    )


def part_gains(
    rows: np.ndarray, families: list[str], target: Target, config: FitConfig
) -> tuple[Score, tuple[float, ...]]:
    """The objective of an assembly, and by how much it falls without each part, all others as they are."""
    samples = objective_samples(target)
    device = launch.choose_device(config.device)
    values = values_at(rows, families, point_blocks(samples.points, device), device)
    tally, blends, held = Tally(samples), rows[:, BLEND], (values < 0).sum(0)
    whole = score_rows(values, blends, tally, config.parsimony)
    # The union of the parts before one is the same for all that follow it.
    gains, before = [], np.full(values.shape[1], FAR, np.float32)
    for index, value in enumerate(values):
        rest = fold([before, *values[index + 1 :]], [0.0, *blends[index + 1 :]])
        score = tally.score(rest < 0, held - (value < 0), len(rows) - 1, config.parsimony)
        gains.append(whole.objective - score.objective)
        before = fold([before, value], [0.0, blends[index]])
    return whole, tuple(gains)


def _box_rows(target: Target, primitive: str) -> np.ndarray:
    """One row (1, ROW): a primitive as large as the target's bounding box, in the middle of it."""
    row = empty_rows(1)
    row[0, TRANSLATION : TRANSLATION + 3] = 0.5 * (target.lower + target.upper)
    size, entry = np.maximum(target.upper - target.lower, 1e-3), family(primitive)
    row[0, SHAPES : SHAPES + SHAPE] = entry.starts(entry, box_solids(size[None]))[0][0]
    return row


def _recorded(config: FitConfig, start: Assembly | None) -> dict[str, Any]:
    """The options that decide the result, JSON values; stages' own only where they are not the preset's."""
    usual = asdict(preset_config(config.preset))
    options: dict[str, Any] = {"preset": config.preset}
    # The trade-off comes after the result and does not change it.
    for name, value in asdict(replace(config, pareto=False)).items():
        if name not in UNRECORDED and (not isinstance(value, dict) or value != usual[name]):
            options[name] = value
    if start is not None:
        options["init_sha256"] = hashlib.sha256(start.to_json()).hexdigest()
    return _plain(options)


def _plain(value: Any) -> Any:
    """Tuples as the lists that JSON makes of them."""
    if isinstance(value, dict):
        return {name: _plain(entry) for name, entry in value.items()}
    return [_plain(entry) for entry in value] if isinstance(value, tuple | list) else value


def _history(outcome: Outcome, primitive: str, transform: Transform) -> History:
    """The story of the rounds, ready for a file."""
    rounds = tuple(
        HistoryRound(
            regions=tuple(
                dict(region) if isinstance(region, dict) else {"source": str(region)}
                for region in entry.regions
            ),
            candidates=entry.candidates.reshape(-1, ROW),
            chosen=entry.chosen.reshape(-1, ROW),
            refined=entry.refined.reshape(-1, ROW),
            kept=entry.kept.reshape(-1, ROW),
            score=score_values(entry.score),
            accepted=entry.accepted,
        )
        for entry in outcome.rounds
    )
    return History(primitive, transform, rounds)
