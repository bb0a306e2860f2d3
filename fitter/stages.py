"""A fit as it was asked for: of the whole or part by part, cut down to the best count, made regular."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import warp as wp

from ..target.target import Target
from .config import FitConfig
from .judge import Judge
from .mirror_pairs import mirror_pairs
from .outcome import Outcome
from .per_part import fit_parts, grid_iou
from .progress import Progress
from .relations import Relation
from .snap import snap
from .standard_form import standard_forms
from .standing import fit_standing
from .ties import Copied
from .trade_off import RICH_SHARE, Cut, cut_down

CURVE_BEGINS, SNAP_BEGINS = 0.7, 0.85
"""Shares of the work, as progress counts it, that are done when these stages begin."""


@dataclass
class Fitted:
    """What a fit came to."""

    outcome: Outcome
    names: list[str] | None = None
    """One a primitive, None where they have none of their own."""
    copies: list[Copied] = field(default_factory=list)
    """Primitives that are others moved."""
    relations: list[Relation] = field(default_factory=list)
    snapped: bool = False
    """Whether the assembly was made regular."""
    notes: list[str] = field(default_factory=list)
    """Sentences about how it was fitted."""
    curve: list[Cut] = field(default_factory=list)
    """The trade-off, the richest first; empty unless asked for."""
    rich_names: list[str] | None = None
    """Names of the parts of the richest one."""


def fit_stages(
    target: Target,
    config: FitConfig,
    device: wp.Device,
    on_progress: Callable[[Progress], None] | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    start_rows: np.ndarray | None = None,
) -> Fitted:
    """Fit a target with everything that the configuration asks for; the arguments are those of `fit_target`."""
    share = CURVE_BEGINS if config.pareto else SNAP_BEGINS if config.snap else 1.0
    tell = on_progress or (lambda progress: None)

    def tell_share(progress: Progress) -> None:
        tell(replace(progress, fraction=share * progress.fraction))

    priced = replace(config, parsimony=RICH_SHARE * config.parsimony) if config.pareto else config
    fitted = None
    if start_rows is None and takes_apart(config):
        parts = fit_parts(target, priced, device, tell_share, should_stop, config.per_part == "on")
        if parts is not None:
            fitted = Fitted(parts.outcome, parts.names, parts.copies, notes=parts.notes)
    if fitted is None:
        fitted = Fitted(fit_standing(target, priced, device, tell_share, should_stop, start_rows))
    if config.pareto and len(fitted.outcome.rows):
        tell(_progress("curve", fitted.outcome, CURVE_BEGINS))
        _cut(fitted, target, config, device, should_stop)
    if config.snap and not fitted.outcome.status.stopped_early:
        tell(_progress("snap", fitted.outcome, SNAP_BEGINS))
        _snap(fitted, target, config, device, should_stop)
    else:
        if not fitted.curve:
            _standardise(fitted, target, config, device)
        fitted.relations = _copies(fitted)
    return fitted


def _progress(stage: str, outcome: Outcome, done: float) -> Progress:
    """A stage after the rounds begins."""
    count = len(outcome.rows)
    return Progress(stage, 1, 1, count, outcome.score.objective, outcome.iou, done, outcome.rows.copy())


def takes_apart(config: FitConfig) -> bool:
    """Whether parts may be fitted one by one: not where the whole has a goal, or a method of others is asked for."""
    if config.per_part != "auto":
        return config.per_part == "on"
    goal = config.target_iou < 1.0 or config.tolerance > 0.0
    return not goal and config.optimizer == "levenberg" and config.decompose == "msd"


def _cut(
    fitted: Fitted, target: Target, config: FitConfig, device: wp.Device, should_stop: Callable[[], bool]
) -> None:
    """The curve, and of it the assembly with the best objective."""
    outcome = fitted.outcome
    judge = Judge(target, config, device)
    cuts = cut_down(outcome.rows, judge, config, should_stop)
    copies = [_copies_in(cut, fitted) for cut in cuts]
    fitted.curve = []
    for cut, tied in zip(cuts, copies, strict=True):
        rows = standard_forms(cut.rows, judge, tied)
        fitted.curve.append(replace(cut, rows=rows, score=judge.score(rows)))
    number = int(np.argmax([cut.score.objective for cut in fitted.curve]))
    best = fitted.curve[number]
    fitted.rich_names = fitted.names
    if fitted.names is not None:
        fitted.names = [fitted.names[old] for old in best.kept]
    fitted.copies = copies[number]
    _take(fitted, best.rows, target, judge)


def _copies_in(cut: Cut, fitted: Fitted) -> list[Copied]:
    """The copies that hold in an assembly of the curve: none where it was refined since."""
    if not np.array_equal(cut.rows, fitted.outcome.rows[list(cut.kept)]):
        return []
    place = {old: new for new, old in enumerate(cut.kept)}
    return [
        replace(copy, source=place[copy.source], index=place[copy.index])
        for copy in fitted.copies
        if copy.source in place and copy.index in place
    ]


def _snap(
    fitted: Fitted, target: Target, config: FitConfig, device: wp.Device, should_stop: Callable[[], bool]
) -> None:
    """The assembly made regular; the relations that hold in it."""
    regular = snap(fitted.outcome.rows, target, config, device, fitted.copies, should_stop)
    if fitted.names is not None:
        names: list[str] = []
        for origin in regular.origin:
            # An image is called after the part that it is an image of.
            name, number = fitted.names[origin], 1
            while name in names:
                name, number = f"{fitted.names[origin]}.image{number}", number + 1
            names.append(name)
        fitted.names = names
    _take(fitted, regular.rows, target, Judge(target, config, device))
    fitted.snapped = True
    fitted.relations = [*_copies(fitted), *regular.relations]


def _standardise(fitted: Fitted, target: Target, config: FitConfig, device: wp.Device) -> None:
    """Each primitive in its standard form, and mirror pairs alike."""
    judge = Judge(target, config, device)
    rows = standard_forms(fitted.outcome.rows, judge, fitted.copies)
    found = mirror_pairs(rows, target, judge, fitted.copies)
    if not np.array_equal(found.rows, fitted.outcome.rows):
        _take(fitted, found.rows, target, judge)
    fitted.copies = list(found.copies)


def _take(fitted: Fitted, rows: np.ndarray, target: Target, judge: Judge) -> None:
    """Put rows in place of the outcome's."""
    fitted.outcome = replace(
        fitted.outcome,
        rows=rows,
        families=judge.families(rows),
        score=judge.score(rows),
        iou=grid_iou(rows, target, judge.config, judge.device),
    )


def _copies(fitted: Fitted) -> list[Relation]:
    """The copies, as relations."""
    names = fitted.names or []
    return [
        Relation(
            "copy",
            (copy.source, copy.index),
            {"of": names[copy.source], "how": "mirrored" if np.linalg.det(copy.turn) < 0 else "moved"},
        )
        for copy in fitted.copies
        if names
    ]
