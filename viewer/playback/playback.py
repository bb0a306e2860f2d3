"""The history of a fit as steps to look at: what every round tried, chose, refined and kept, then the result.

No windows here. Parts that a round goes on from keep their names from step to step, so that players can follow them;
those that end up in the result have its names and colours from the beginning.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from resfit.errors import AssemblyError, InputError

from ...assembly.assembly import Assembly
from ...assembly.colors import palette_color
from ...assembly.history import History, HistoryRound
from ...assembly.plain_json import number_at
from ...assembly.primitive import Primitive
from ...assembly.report import read_report
from ...kernels.field.bounds import extents
from ...kernels.rotation import matrix_of
from ...kernels.rows import BLEND, ROTATION, ROW, TRANSLATION

Stage = Literal["regions", "candidates", "chosen", "refined", "kept", "rejected", "begin", "live", "final"]

TITLES: dict[Stage, str] = {
    "regions": "regions to explain",
    "candidates": "candidates",
    "chosen": "chosen",
    "refined": "refined together",
    "kept": "kept",
    "rejected": "rejected, no better than before",
}

GREY = "#b4b9c0"
"""Colour of parts that were rejected."""

FROM_NOTHING = "solid"
"""Source of the region that is everything there is: only a beginning without any part proposes it."""

SAME_PART = 0.25
"""Normalised units: a part of the result that is farther, in place and size, from all that were kept is a new one."""


@dataclass(frozen=True)
class Frame:
    """One step. Everything is in the normalised frame."""

    stage: Stage
    round: int
    """From 1 on; that of the last one for the result."""
    title: str
    detail: str
    assembly: Assembly
    """The parts of the moment."""
    faint: tuple[Primitive, ...] = ()
    """Candidates that were not there before."""
    boxes: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 3), np.float32))
    """Lowest and highest corners of regions, (n, 2, 3) float32."""
    strength: float = 1.0
    """How strongly candidates and boxes are drawn, 0 to 1."""


@dataclass(frozen=True)
class _Set:
    """Rows (k, ROW), a number for each part that is the same in all steps, and what is known of the whole."""

    rows: np.ndarray
    ids: tuple[int, ...]
    figures: str = ""

    def by_row(self) -> dict[bytes, int]:
        return {row.tobytes(): id for row, id in zip(self.rows, self.ids, strict=True)}


NOTHING = _Set(np.zeros((0, ROW), np.float32), (), "nothing yet")


def load_playback(folder: Path, assembly: Assembly) -> tuple[Frame, ...]:
    """The steps of the fit in a folder, the last of them its assembly.

    Raises:
        InputError: if there is no history, it cannot be read, or is that of another fit.
    """
    path = folder / "history.npz"
    if not path.is_file():
        raise InputError(f"'{folder}' holds no history.npz; give the folder of a fit.")
    history = History.load(path)
    if history.transform != assembly.transform:
        raise InputError(f"'{path}' is the history of another fit than the assembly.json beside it.")
    try:
        return playback(history, assembly, reported_iou(folder))
    except AssemblyError as error:
        raise InputError(f"'{path}' is damaged: a row in it is no {history.family}.") from error


def playback(history: History, assembly: Assembly, iou: float | None = None) -> tuple[Frame, ...]:
    """The steps of a fit.

    Args:
        history: of the fit.
        assembly: what it came to; it is the last step as it is.
        iou: of that, if known.
    """
    rounds = list(_followed(history))
    names, colors = _named(
        assembly, [sets["kept"] for entry, _, sets in rounds if entry.accepted], history.family
    )
    count, seen, frames = len(rounds), set[bytes](), []
    for number, (entry, start, sets) in enumerate(rounds, 1):
        new = [row for row in entry.candidates if _is_new(row, seen)]
        verdict: Stage = "kept" if entry.accepted else "rejected"
        shown: tuple[tuple[Stage, _Set, str], ...] = (
            ("regions", start, f"{_sources(entry.regions)} · {start.figures}"),
            (
                "candidates",
                start,
                f"{len(entry.candidates)} candidates, {len(new)} of them new · {start.figures}",
            ),
            ("chosen", sets["chosen"], f"{_parts(len(entry.chosen))} of {len(entry.candidates)} candidates"),
            ("refined", sets["refined"], _parts(len(entry.refined))),
            (verdict, sets["kept"], sets["kept"].figures),
        )
        for stage, parts, detail in shown:
            primitives = tuple(
                Primitive.from_row(
                    history.family, names.get(id, f"step_{id:04d}"), row,
                    GREY if stage == "rejected" else colors.get(id, palette_color(id)),
                )
                for row, id in zip(parts.rows, parts.ids, strict=True)
            )  # fmt: skip
            again = " · a new beginning" if number > 1 and _begins_anew(entry) else ""
            frame = Frame(
                stage, number, f"Round {number} of {count}{again} · {TITLES[stage]}", detail,
                Assembly(primitives, history.transform),
            )  # fmt: skip
            if stage == "regions":
                frame = replace(frame, boxes=region_boxes(entry.regions))
            elif stage == "candidates":
                faint = (Primitive.from_row(history.family, f"new_{k:04d}", row) for k, row in enumerate(new))
                frame = replace(frame, faint=tuple(faint))
            frames.append(frame)
    return (*frames, final_frame(assembly, count, iou))


def final_frame(assembly: Assembly, rounds: int, iou: float | None, objective: float | None = None) -> Frame:
    """The step that shows what a fit came to."""
    detail = figures(len(assembly.primitives), iou, objective)
    if not rounds:
        detail += " · fitted part by part, without rounds"
    return Frame("final", rounds, "The result", detail, assembly)


def _begins_anew(entry: HistoryRound) -> bool:
    """True if a round begins without any part, as the first ones of a fit's tracks do."""
    return any(region.get("source") == FROM_NOTHING for region in entry.regions)


def region_boxes(regions: Iterable[Mapping[str, Any]]) -> np.ndarray:
    """Corners (n, 2, 3) float32 of the boxes of regions, normalised frame; those without a box are left out."""
    boxes = [
        [
            -1.0 + 2.0 * np.asarray(region[edge], np.float64) / region["resolution"]
            for edge in ("lower", "upper")
        ]
        for region in regions
        if {"lower", "upper", "resolution"} <= set(region)
    ]
    return np.asarray(boxes, np.float32).reshape(-1, 2, 3)


def reported_iou(folder: Path) -> float | None:
    """The IoU in the report of a fit's folder, if there is one."""
    return number_at(read_report(folder), "metrics", "iou")


def _followed(history: History) -> Iterable[tuple[HistoryRound, _Set, dict[str, _Set]]]:
    """Every round with the parts that it goes on from, and those of its steps, numbered.

    A history does not say where a track begins that goes on from the best so far: parts that a choice holds on to are
    in it to the bit, and tell.
    """
    earlier: list[_Set] = [NOTHING]
    next_id = 0
    for entry in history.rounds:
        held = {row.tobytes() for row in entry.chosen}
        start = NOTHING
        if not _begins_anew(entry):
            # Of equal ones the latest.
            start = max(reversed(earlier), key=lambda parts: len(held & set(parts.by_row())))
        known, ids = start.by_row(), []
        for row in entry.chosen:
            id = known.pop(row.tobytes(), None)
            if id is None:
                id, next_id = next_id, next_id + 1
            ids.append(id)
        chosen = _Set(entry.chosen, tuple(ids))
        # Refinement keeps order and number.
        refined = _Set(entry.refined, tuple(ids[: len(entry.refined)]))
        known, ids = refined.by_row(), []
        for row in entry.kept:
            id = known.pop(row.tobytes(), None)
            if id is None:
                id, next_id = next_id, next_id + 1
            ids.append(id)
        scored = figures(len(entry.kept), entry.score.get("volume_iou"), entry.score.get("objective"))
        kept = _Set(entry.kept, tuple(ids), scored)
        yield entry, start, {"chosen": chosen, "refined": refined, "kept": kept}
        if entry.accepted:
            earlier.append(kept)


def _named(assembly: Assembly, kept: Sequence[_Set], family: str) -> tuple[dict[int, str], dict[int, str]]:
    """Names and colours by number of the parts that end up in the result: those of the nearest set that was kept."""
    best: tuple[list[tuple[int, int]], float] = ([], 0.0)
    for parts in kept:
        pairs, closeness = matches(assembly.rows(), parts.rows, family)
        if closeness > best[1]:
            best = [(k, parts.ids[j]) for k, j in pairs], closeness
    primitives = assembly.primitives
    names = {id: primitives[k].name for k, id in best[0]}
    return names, {id: primitives[k].color for k, id in best[0]}


def matches(rows: np.ndarray, others: np.ndarray, family: str) -> tuple[list[tuple[int, int]], float]:
    """Match parts of two sets of one family, rows (k, ROW), that are much the same in place and size.

    Returns:
        Pairs of indices, and how close the sets are: 0 for nothing in common.
    """
    from scipy.optimize import linear_sum_assignment

    away = np.linalg.norm(_places(rows, family)[:, None] - _places(others, family)[None], axis=2)
    away = np.minimum(away, SAME_PART)
    pairs = [(int(k), int(j)) for k, j in zip(*linear_sum_assignment(away), strict=True)]
    closeness = float(sum(SAME_PART - away[pair] for pair in pairs))
    return [pair for pair in pairs if away[pair] < SAME_PART], closeness


def _places(rows: np.ndarray, family: str) -> np.ndarray:
    """Centres and extents along the frame's axes, (k, 6) float64, of rows (k, ROW): the same however axes are named."""
    # Large float32 numbers have no squares.
    wide = rows.astype(np.float64)
    turns = matrix_of(wide[:, ROTATION : ROTATION + 4])
    sides = np.einsum("kij,kj->ki", np.abs(turns), extents(rows, [family] * len(rows)))
    return np.concatenate([wide[:, TRANSLATION : TRANSLATION + 3], sides], axis=1)


def _is_new(row: np.ndarray, seen: set[bytes]) -> bool:
    """True if a candidate was not there in an earlier round; blends are set anew in each."""
    key = row[:BLEND].tobytes()
    is_new = key not in seen
    seen.add(key)
    return is_new


def _sources(regions: Sequence[Mapping[str, Any]]) -> str:
    """Number of regions, and where most of them come from."""
    kinds = Counter(str(region.get("source", "?")).split(" ")[0] for region in regions)
    listed = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common(4))
    return f"{len(regions)} regions: {listed}" if regions else "no regions"


def _parts(count: int) -> str:
    return f"{count} part" if count == 1 else f"{count} parts"


def figures(count: int, iou: float | None, objective: float | None) -> str:
    """Figures of a set, in a line; without what is None."""
    text = _parts(count)
    text += f" · IoU {iou:.3f}" if iou is not None else ""
    return text + (f" · objective {objective:.3f}" if objective is not None else "")
