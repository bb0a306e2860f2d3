"""A fit as it was asked for: of the whole or part by part, with few enough parts, made regular; its trade-off."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np
import warp as wp

from ..shape.target import Target
from .config import MOST_PRIMITIVES, FitConfig
from .objective.cached import CachedObjective
from .outcome import Outcome, Status
from .progress import Progress
from .regularise.constraints import Copied
from .regularise.mirror_pairs import mirror_pairs
from .regularise.relations import Relation
from .regularise.snap import snap
from .regularise.standard_form import standard_forms
from .search.pareto import RICH_SHARE, Cut, cut_down, places_in, reductions, trade_off
from .search.per_part import fit_parts, grid_iou, name_primitives
from .search.proposals import is_baseline
from .search.reduction import Reduction
from .search.standing import fit_standing

CURVE_BEGINS, SNAP_BEGINS, REDUCTION_BEGINS = 0.25, 0.85, 0.55
"""Shares of the work up to the end of these stages, as progress counts it, that are done when they begin."""


@dataclass
class Fitted:
    """Result of a fit."""

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
    """The trade-off, the fewest parts first; empty unless asked for."""


def fit_stages(
    target: Target,
    config: FitConfig,
    device: wp.Device,
    on_progress: Callable[[Progress], None] | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    start_rows: np.ndarray | None = None,
) -> Fitted:
    """Fit a target with everything that the configuration asks for; the arguments are those of `fit_target`."""
    begin = time.perf_counter()

    def stopped() -> bool:
        return should_stop() or 0 < config.timeout < time.perf_counter() - begin

    tell = on_progress or (lambda progress: None)
    before_curve = CURVE_BEGINS if config.pareto else 1.0
    before_snap = before_curve * (SNAP_BEGINS if config.snap else 1.0)
    free = replace(config, max_primitives=MOST_PRIMITIVES) if _reduces(config) else config
    before_reduction = before_snap * (1.0 if free is config else REDUCTION_BEGINS)
    fitted = _fit(target, free, device, _in_share(tell, before_reduction), should_stop, start_rows)
    full = fitted.outcome.rows
    if len(full) > config.max_primitives:
        tell(_progress("reduce", fitted.outcome, before_reduction))
        _reduce(fitted, target, config, device, stopped)
        if stopped() and not fitted.outcome.status.stopped_early:
            # Fewer parts than were found, but hardly the best so few.
            fitted.outcome.status = Status.INTERRUPTED if should_stop() else Status.TIMEOUT
    if config.snap and not fitted.outcome.status.stopped_early:
        tell(_progress("snap", fitted.outcome, before_snap))
        _snap(fitted, target, config, device, should_stop)
    else:
        _standardise(fitted, target, config, device)
        fitted.relations = _copies(fitted)
    if config.pareto and len(full):
        tell(_progress("curve", fitted.outcome, before_curve))
        fitted.curve = _curve(fitted.outcome, full, target, config, device, stopped)
    return fitted


def _fit(
    target: Target,
    config: FitConfig,
    device: wp.Device,
    tell: Callable[[Progress], None],
    should_stop: Callable[[], bool],
    start_rows: np.ndarray | None = None,
) -> Fitted:
    """The fit alone, part by part or of the whole."""
    if start_rows is None and takes_apart(config):
        parts = fit_parts(target, config, device, tell, should_stop, config.per_part == "on")
        if parts is not None:
            return Fitted(parts.outcome, parts.names, parts.copies, notes=parts.notes)
    return Fitted(fit_standing(target, config, device, tell, should_stop, start_rows))


def _in_share(tell: Callable[[Progress], None], share: float) -> Callable[[Progress], None]:
    """Progress callback within the first share of the work."""
    return lambda progress: tell(replace(progress, fraction=share * progress.fraction))


def _reduces(config: FitConfig) -> bool:
    """True if a fit takes as many parts as pay, then as few as are allowed: not by others' methods."""
    return not is_baseline(config) and config.max_primitives < MOST_PRIMITIVES


def _progress(stage: str, outcome: Outcome, done: float) -> Progress:
    """A stage after the rounds begins."""
    count = len(outcome.rows)
    return Progress(stage, 1, 1, count, outcome.score.objective, outcome.iou, done, outcome.rows.copy())


def takes_apart(config: FitConfig) -> bool:
    """True if parts may be fitted one by one: not with a goal for the whole, or a method of others."""
    if config.per_part != "auto":
        return config.per_part == "on"
    goal = config.target_iou < 1.0 or config.tolerance > 0.0
    return not goal and not is_baseline(config)


def _reduce(
    fitted: Fitted, target: Target, config: FitConfig, device: wp.Device, should_stop: Callable[[], bool]
) -> None:
    """The best assembly of as many parts as are allowed in place of the fit's."""
    full, early = fitted.outcome, fitted.outcome.status.stopped_early
    reduction = Reduction(full.rows, target, config, device, should_stop)
    while len(reduction.rows) > config.max_primitives:
        reduction.step()
    rows = reduction.improved(len(reduction.rows))
    if fitted.names is not None:
        names = fitted.names
        places = places_in(full.rows, rows, reduction.cached_objective)
        fitted.names = name_primitives([names[place] if place < len(names) else "part" for place in places])
    fitted.copies = []
    _take(fitted, rows, target, reduction.cached_objective)
    if not early:
        few = len(fitted.outcome.rows) < config.max_primitives
        fitted.outcome.status = Status.SATURATED if few else Status.MAX_PRIMITIVES
    some = "part" if len(rows) == 1 else f"{len(rows)} parts"
    advice = (
        "raise --max-primitives for more"
        if len(rows) == config.max_primitives
        else f"none better was found with {config.max_primitives}"
    )
    fitted.notes.append(f"The best {some} in place of {len(full.rows)}; {advice}.")


def _curve(
    outcome: Outcome,
    full: np.ndarray,
    target: Target,
    config: FitConfig,
    device: wp.Device,
    should_stop: Callable[[], bool],
) -> list[Cut]:
    """The trade-off: of the outcome, of fits that may have fewer parts, and of one in which parts are cheaper.

    Args:
        outcome: the fit's own.
        full: its rows before there were to be fewer or regular ones.
        target, config, device, should_stop: as in `fit_stages`.
    """
    cached_objective = CachedObjective(target, config, device)
    rich = full
    if not should_stop():
        price = RICH_SHARE * config.parsimony
        cheaper = replace(config, parsimony=price, max_primitives=MOST_PRIMITIVES, timeout=0.0)
        rich = _fit(target, cheaper, device, lambda progress: None, should_stop).outcome.rows
    others = [cut_down(rich, cached_objective, config, should_stop)]
    if _reduces(replace(config, max_primitives=1)):
        others.append(reductions(Reduction(full, target, config, device, should_stop)))
    return trade_off(
        outcome.rows, chain([full], *others), cached_objective, max(config.max_primitives, len(outcome.rows))
    )


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
    _take(fitted, regular.rows, target, CachedObjective(target, config, device))
    fitted.snapped = True
    fitted.relations = [*_copies(fitted), *regular.relations]


def _standardise(fitted: Fitted, target: Target, config: FitConfig, device: wp.Device) -> None:
    """Each primitive in its standard form, and mirror pairs alike."""
    cached_objective = CachedObjective(target, config, device)
    rows = standard_forms(fitted.outcome.rows, cached_objective, fitted.copies)
    found = mirror_pairs(rows, target, cached_objective, fitted.copies)
    if not np.array_equal(found.rows, fitted.outcome.rows):
        _take(fitted, found.rows, target, cached_objective)
    fitted.copies = list(found.copies)


def _take(fitted: Fitted, rows: np.ndarray, target: Target, cached_objective: CachedObjective) -> None:
    """Put rows in place of the outcome's."""
    fitted.outcome = replace(
        fitted.outcome,
        rows=rows,
        families=cached_objective.families(rows),
        score=cached_objective.score(rows),
        iou=grid_iou(rows, target, cached_objective.config, cached_objective.device),
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
