"""Fitting the parts of a mesh one by one, each in its own frame, and putting them together into one assembly.

Parts that are copies of others are not fitted again: they get the same primitives, moved.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from ...assembly.change_of_frame import rescale_rows
from ...decomposition.region import region_from_mask
from ...kernels.field.evaluate import cell_centres, evaluate_grid
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.rows import BLEND, ROW
from ...kernels.runtime.launch import serial_device
from ...kernels.select.coverage_sets import hold
from ...shape.grid import intersection_over_union
from ...shape.parts import Piece, piece_target, split_target
from ...shape.repeated_parts import Copy, find_copies
from ...shape.target import Target
from ..config import FitConfig
from ..objective.cached import CachedObjective
from ..outcome import Outcome, Status
from ..progress import Progress
from ..propose.candidates import fit_regions
from ..refine.joint import refine
from ..refine.refiner import REFINERS
from ..regularise.constraints import Copied
from ..regularise.rigid_motion import move_rows
from ..select.selection import prune
from .multi_start import fit_target
from .pareto import remove_down_to

LEAST_PARTS, MOST_SHARE = 3, 0.8
"""Unless told to, a mesh is not taken apart if fewer parts than this are worth a primitive, or one is nearly all."""

LARGE_SHARE = 0.05
"""Parts with a larger share of the whole are fitted like a mesh of their own; smaller ones with less work."""

MAIN_SHARE = 0.4
"""Only a part with a larger share gets all rounds and all regions."""

LEAST_REGIONS = 12
"""Regions tried in a round for the smallest parts."""

MOST_ALPHA = 0.15
"""Price of a primitive in the smallest parts: one is always worth it, a second one only where it is plain to see."""

SMALL_RESOLUTION = 64
"""Cells along a side for small parts: their own box is small, so that these are finer than the whole's."""

LEAST_SAMPLES = 2048
"""Points near the surface, and as many in the volume, of the smallest parts."""


@dataclass(frozen=True)
class PartsOutcome:
    """An assembly made part by part."""

    outcome: Outcome
    names: list[str]
    """One a primitive: that of its part, with a number from the second on."""
    copies: list[Copied]
    """Which primitives are others moved."""
    notes: list[str]
    """Sentences about what was fitted and what was left out."""


def fit_parts(
    target: Target,
    config: FitConfig,
    device: wp.Device,
    on_progress: Callable[[Progress], None] | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    everything: bool = True,
) -> PartsOutcome | None:
    """Fit every part of a target by itself.

    Args:
        target: the whole.
        config: options; `max_primitives` is for the whole, parts get their share of it.
        device: where the kernels run.
        on_progress: called for each part.
        should_stop: asked often; parts that were not reached then are missing.
        everything: keep at least one primitive of each part, as far as `max_primitives` goes; else parts and
            primitives that do not pay their price are left out, as in the fit of the whole.

    Returns:
        None if there are no parts to fit, or, with `everything` False, too few that are worth it.
    """
    begin = time.perf_counter()
    pieces = split_target(target)
    chosen = choose_pieces(pieces, config, everything)
    if not chosen:
        return None
    total, pieces = len(pieces), [pieces[index] for index in chosen]
    copies = find_copies(pieces)
    timings = {"split": time.perf_counter() - begin}

    def out_of_time() -> bool:
        return 0 < config.timeout < time.perf_counter() - begin

    fitted = _fit_originals(
        pieces, copies, target, config, device, on_progress or (lambda progress: None),
        lambda: should_stop() or out_of_time(), timings,
    )  # fmt: skip
    missing = sum(copy is None for copy in copies) - len(fitted)
    status = Status.SATURATED
    if missing or should_stop() or out_of_time():
        status = Status.INTERRUPTED if should_stop() else Status.TIMEOUT
    rows, owner, order = put_together(pieces, copies, fitted)
    cached_objective = CachedObjective(target, config, device)
    kept, note = limit(rows, cached_objective, 0.0 if everything else config.parsimony, config.max_primitives)
    tied = copies_among(copies, owner, order, kept.tolist())
    rows, names = rows[kept], name_primitives([pieces[part].name for part in owner[kept]])
    iou = grid_iou(rows, target, config, device)
    outcome = Outcome(
        rows, cached_objective.families(rows), cached_objective.score(rows), iou, status, [], timings
    )
    count = sum(copy is not None for copy in copies)
    same = f", {count} of them copies of others" if count else ""
    some = f"the {len(pieces)} largest of {total} parts" if len(pieces) < total else f"{total} parts"
    notes = [f"Fitted one by one: {some}{same}."]
    if missing:
        notes.append(f"Stopped before {missing} of the parts were fitted.")
    return PartsOutcome(outcome, names, tied, notes + note)


def choose_pieces(pieces: list[Piece], config: FitConfig, everything: bool) -> list[int]:
    """Indices, ascending, of the parts to fit: the largest ones; none where the whole is to be fitted instead."""
    order = sorted(range(len(pieces)), key=lambda k: -pieces[k].share)
    if everything:
        return sorted(order[: config.max_primitives]) if len(pieces) > 1 else []
    # The objective can rise by no more than about a part's share: less than its price is not worth a fit.
    worth = [index for index in order if pieces[index].share > config.parsimony]
    if len(worth) < LEAST_PARTS or pieces[order[0]].share > MOST_SHARE:
        return []
    return sorted(worth[: config.max_primitives])


def _fit_originals(
    pieces: list[Piece],
    copies: list[Copy | None],
    target: Target,
    config: FitConfig,
    device: wp.Device,
    tell: Callable[[Progress], None],
    should_stop: Callable[[], bool],
    timings: dict[str, float],
) -> dict[int, np.ndarray]:
    """The primitives of every part that is no copy, by its index; large parts first, so that a stop costs little."""
    fitted: dict[int, np.ndarray] = {}
    done, total = 0.0, sum(piece.share for piece in pieces)
    for index in sorted(range(len(pieces)), key=lambda k: -pieces[k].share):
        if copies[index] is None:
            if should_stop():
                break
            held = sum(len(rows) for rows in fitted.values())
            rows, _, _ = put_together(pieces, copies, fitted)
            tell(Progress("parts", len(fitted) + 1, len(pieces), held, 0.0, 0.0, done / total, rows))
            fitted[index], spent = fit_piece(pieces[index], target, config, device, should_stop)
            for stage, seconds in spent.items():
                timings[stage] = timings.get(stage, 0.0) + seconds
        done += pieces[index].share
    return fitted


def fit_piece(
    piece: Piece, whole: Target, config: FitConfig, device: wp.Device, should_stop: Callable[[], bool]
) -> tuple[np.ndarray, dict[str, float]]:
    """Fit one part: its primitives (k, ROW) in the frame of the whole, and wall seconds by stage."""
    small = piece.share < LARGE_SHARE
    most = max(1, min(config.max_primitives, round(2 * piece.share * config.max_primitives)))
    own = replace(
        config,
        parsimony=min(MOST_ALPHA, config.parsimony / max(piece.share, 1e-6)),
        max_primitives=most,
        samples=max(LEAST_SAMPLES, min(config.samples, round(4 * piece.share * config.samples))),
        target_iou=1.0,
        tolerance=0.0,
        timeout=0.0,
    )
    if piece.share < MAIN_SHARE:
        work = min(1.0, 2.0 * piece.share)
        propose = replace(
            config.propose,
            regions=max(LEAST_REGIONS, round(work * config.propose.regions)),
            splits=round(work * config.propose.splits),
            merges=round(work * config.propose.merges),
        )
        own = replace(own, propose=propose, rounds=min(2 if small else 5, config.rounds), excursions=0)
    resolution = SMALL_RESOLUTION if small else config.resolution
    target = piece_target(piece, whole, device, resolution, own.samples, config.seed)
    frame = target.transform
    if most == 1 and not REFINERS[config.optimizer].selects:
        rows, timings = fit_one_primitive(target, own, device), {}
    else:
        outcome = fit_target(target, own, device, should_stop=should_stop)
        rows, timings = outcome.rows, outcome.timings
    families = [config.primitive] * len(rows)
    return rescale_rows(rows, families, frame.scale, frame.translation), timings


def fit_one_primitive(target: Target, config: FitConfig, device: wp.Device) -> np.ndarray:
    """The best single primitive of a target, (1, ROW), or none, (0, ROW), where nothing is solid: no rounds."""
    region = region_from_mask(target.grid < 0, np.zeros(3, np.int32), target.resolution, "solid")
    if region is None:
        return np.zeros((0, ROW), np.float32)
    found = fit_regions([region], target.grid, config.primitive, config.propose, config.seed, device).rows
    cached_objective = CachedObjective(target, config, device)
    best = max(range(len(found)), key=lambda k: cached_objective.objective(found[k : k + 1]))
    row = found[best : best + 1]
    refined = refine(row, cached_objective.families(row), cached_objective.samples, config.refine, device)
    return max(row, refined, key=cached_objective.objective)


def put_together(
    pieces: list[Piece], copies: list[Copy | None], fitted: dict[int, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All primitives, part by part: rows (k, ROW), the part of each (k,), and its place in the part (k,)."""
    blocks, owners, places = [np.zeros((0, ROW), np.float32)], [], []
    for index in range(len(pieces)):
        copy = copies[index]
        rows = fitted.get(index if copy is None else copy.source)
        if rows is None:
            continue
        if copy is not None:
            rows = move_rows(rows, copy.turn, np.zeros(3), copy.shift)
        rows = rows.copy()
        # The first one's blend was unused; with other parts before it, it would be used.
        rows[:1, BLEND] = 0.0
        blocks.append(rows)
        owners += [index] * len(rows)
        places += range(len(rows))
    return np.concatenate(blocks), np.array(owners, np.int64), np.array(places, np.int64)


def limit(
    rows: np.ndarray, cached_objective: CachedObjective, price: float, most: int
) -> tuple[np.ndarray, list[str]]:
    """Prune to primitives that earn more than a price, and at most `most`; the least missed go one by one.

    Returns:
        Their indices, ascending, and a sentence if `most` was too few.
    """
    kept = np.arange(len(rows))
    if not len(rows):
        return kept, []
    coverage = hold(cached_objective.values(rows) < 0, serial_device())
    kept = kept[prune(coverage, cached_objective.tally, price)]
    if len(kept) <= most:
        return kept, []
    note = f"{len(kept)} primitives cut to {most}; raise --max-primitives to keep more."
    return kept[remove_down_to(cached_objective.values(rows[kept]), cached_objective, most)], [note]


def name_primitives(parts: list[str]) -> list[str]:
    """`wheel`, `wheel.2`, `wheel.3`, `axle`: names of primitives from those of their parts, all different."""
    counts: dict[str, int] = {}
    names = []
    for part in parts:
        counts[part] = counts.get(part, 0) + 1
        names.append(part if counts[part] == 1 else f"{part}.{counts[part]}")
    return names


def grid_iou(rows: np.ndarray, target: Target, config: FitConfig, device: wp.Device) -> float:
    """IoU (0 to 1) at the cell centres of the target's grid."""
    if not len(rows):
        return 0.0
    primitives = PrimitiveSet(rows, [config.primitive] * len(rows), device)
    held = evaluate_grid(primitives, *cell_centres(target.resolution)) < 0
    return intersection_over_union(held, target.grid < 0)


def copies_among(
    copies: list[Copy | None], owner: np.ndarray, place: np.ndarray, kept: list[int]
) -> list[Copied]:
    """Congruent copies among the primitives `kept`, by their new indices: others of them moved.

    Args:
        copies: of the parts.
        owner, place: (k,) part of each primitive, and its place in the part, before any were left out.
        kept: indices, ascending, of those that are left.
    """
    at = {(int(owner[old]), int(place[old])): new for new, old in enumerate(kept)}
    found = []
    for (part, number), index in at.items():
        copy = copies[part]
        if copy is not None and (copy.source, number) in at:
            found.append(Copied(at[copy.source, number], index, copy.turn, copy.shift))
    return found
