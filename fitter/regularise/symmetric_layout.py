"""The parts of an assembly tied by the symmetries of its target: copied across, or made symmetric where astride."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...kernels.rows import BLEND
from ..objective.cached import CachedObjective
from .constraints import Constraints, Copied, symmetric_row
from .rigid_motion import move_rows
from .symmetry import Symmetry

MATCH = 0.45
"""IoU, on the samples, of a part's image and another part for the two to be the same: both were fitted freely."""

SELF_MATCH = 0.6
"""The same for a part that a motion takes to itself."""

CROSSING = 0.3
"""The same for a part that lies across a plane where one side is copied onto the other: it is made symmetric."""

Motion = tuple[np.ndarray, np.ndarray]
"""turn (3, 3) and shift (3,): p = turn @ q + shift."""


@dataclass(frozen=True)
class Layout:
    """Rows and ties, and which rows have no partner."""

    rows: np.ndarray
    constraints: Constraints
    alone: tuple[tuple[int, tuple[Motion, ...]], ...]
    """Primitives with images where there is no part, and the motions to them."""
    origin: tuple[int, ...]
    """For each row the primitive that it was, or is an image of, in the assembly that the layout was made from."""


def motions_of(symmetries: list[Symmetry], most: int = 24) -> list[Motion]:
    """All motions that some symmetries generate, without the identity; none where they are more than `most`."""
    generators = [
        (turn, found.centre - turn @ found.centre) for found in symmetries for turn in found.turns()[:1]
    ]
    group: list[Motion] = [(np.eye(3), np.zeros(3))]
    for known in group:
        for turn, shift in generators:
            product = (turn @ known[0], turn @ known[1] + shift)
            if not any(_same(product, other) for other in group):
                group.append(product)
        if len(group) > most:
            return []
    return group[1:]


def lay_out(
    rows: np.ndarray, motions: list[Motion], cached_objective: CachedObjective, fixed: set[int]
) -> Layout:
    """Match every part's images with parts, and tie what matches.

    Args:
        rows: (primitive_count, ROW).
        motions: a group without the identity.
        cached_objective: tells what parts hold.
        fixed: primitives that are tied already, and stay out of it.
    """
    families = cached_objective.families(rows)
    bits = (cached_objective.values(rows) < 0).astype(np.float32)
    left = [index for index in np.argsort(-bits.sum(1), kind="stable").tolist() if index not in fixed]
    rows = rows.copy()
    copies: list[Copied] = []
    astride: dict[int, tuple[Motion, ...]] = {}
    alone: list[tuple[int, tuple[Motion, ...]]] = []
    while left:
        index = left.pop(0)
        images = np.concatenate([move_rows(rows[index : index + 1], t, np.zeros(3), s) for t, s in motions])
        shares = _shares(cached_objective.values(images) < 0, bits)
        self_motions = tuple(m for m, share in zip(motions, shares, strict=True) if share[index] > SELF_MATCH)
        if self_motions:
            astride[index] = self_motions
            rows[index] = symmetric_row(rows[index], families[index], self_motions)
        missing, taken, placed = [], [], [rows[index]]
        for number, (turn, shift) in enumerate(motions):
            image = move_rows(rows[index : index + 1], turn, np.zeros(3), shift)
            if shares[number, index] > SELF_MATCH or _is_there(image[0], placed):
                continue
            placed.append(image[0])
            partner = max(left, key=lambda other: shares[number, other], default=None)
            if partner is None or shares[number, partner] < MATCH:
                missing.append((turn, shift))
                continue
            left.remove(partner)
            taken.append(Copied(index, partner, turn, shift))
        copies += taken
        if missing:
            alone.append((index, tuple(missing)))
    constraints = Constraints(tuple(copies), astride)
    return Layout(constraints.complete(rows, families), constraints, tuple(alone), tuple(range(len(rows))))


def copy_across(
    rows: np.ndarray,
    planes: list[Symmetry],
    sides: tuple[float, ...],
    cached_objective: CachedObjective,
    fixed: set[int],
    most: int,
) -> Layout | None:
    """One side's parts copied onto the other, whatever is there.

    Args:
        rows: (primitive_count, ROW).
        planes: at right angles to each other.
        sides: for each plane 1 or -1, the side that is copied.
        cached_objective: tells what parts hold.
        fixed: primitives that stay as they are.
        most: primitives; None is returned where more were needed.
    """
    motions = motions_of(planes)
    families = cached_objective.families(rows)
    bits = (cached_objective.values(rows) < 0).astype(np.float32)
    kept, astride, alone = [], {}, []
    for index in range(len(rows)):
        if index in fixed:
            kept.append(index)
            continue
        images = np.concatenate([move_rows(rows[index : index + 1], t, np.zeros(3), s) for t, s in motions])
        shares = _shares(cached_objective.values(images) < 0, bits[index : index + 1])[:, 0]
        own = tuple(m for m, share in zip(motions, shares, strict=True) if share > CROSSING)
        heights = [
            side * float((rows[index, :3] - plane.centre) @ plane.axis)
            for plane, side in zip(planes, sides, strict=True)
        ]
        crossed = [bool(shares[_index_of(plane, motions)] > CROSSING) for plane in planes]
        if all(across or height > 0 for across, height in zip(crossed, heights, strict=True)):
            kept.append(index)
            if own:
                astride[index] = own
            alone.append(
                (index, tuple(m for m, share in zip(motions, shares, strict=True) if share <= CROSSING))
            )
    place = {old: new for new, old in enumerate(kept)}
    constraints = Constraints((), {place[index]: own for index, own in astride.items()})
    layout = Layout(constraints.complete(rows[kept], families), constraints, (), tuple(kept))
    for index, missing in alone:
        layout = _with_images(layout, place[index], missing, cached_objective)
    return layout if 0 < len(layout.rows) <= most else None


def _index_of(plane: Symmetry, motions: list[Motion]) -> int:
    """Index of the motion that is the reflection in a plane."""
    turn = plane.turns()[0]
    return min(range(len(motions)), key=lambda k: float(np.abs(motions[k][0] - turn).max()))


def _with_images(
    layout: Layout, index: int, motions: tuple[Motion, ...], cached_objective: CachedObjective
) -> Layout:
    """The layout with images of a primitive, at the end; images that fall together are one."""
    row = layout.rows[index : index + 1]
    more, placed = [], []
    for turn, shift in motions:
        image = move_rows(row, turn, np.zeros(3), shift)
        if not _is_there(image[0], placed):
            placed.append(image[0])
            more.append(Copied(index, len(layout.rows) + len(more), turn, shift))
    if not more:
        return layout
    rows = np.concatenate([layout.rows, np.stack(placed)])
    rows[len(layout.rows) :, BLEND] = row[0, BLEND]
    constraints = Constraints((*layout.constraints.copies, *more), layout.constraints.astride)
    origin = (*layout.origin, *[layout.origin[index]] * len(more))
    return Layout(
        constraints.complete(rows, cached_objective.families(rows)), constraints, layout.alone, origin
    )


def resolved(layout: Layout, cached_objective: CachedObjective, most: int) -> list[Layout]:
    """The layouts in which the first part without a partner got one, if there is room, and in which it is gone."""
    (index, motions), rest = layout.alone[0], layout.alone[1:]
    found = [_without(layout, index, rest)]
    if len(layout.rows) + len(motions) <= most:
        found.append(_with_images(replace(layout, alone=rest), index, motions, cached_objective))
    return found


def without_idle(layout: Layout, cached_objective: CachedObjective) -> Layout:
    """The layout less the primitives, with all that follows from them, without which the objective is higher."""
    objective = cached_objective.objective(layout.rows)
    while len(layout.rows) > 1:
        candidates = [
            _without(layout, index, layout.alone) for index in layout.constraints.free(len(layout.rows))
        ]
        scores = [
            cached_objective.objective(candidate.rows) if len(candidate.rows) else -1.0
            for candidate in candidates
        ]
        best = int(np.argmax(scores))
        if scores[best] <= objective:
            break
        objective, layout = scores[best], candidates[best]
    return layout


def _without(layout: Layout, index: int, alone: tuple[tuple[int, tuple[Motion, ...]], ...]) -> Layout:
    """The layout less a primitive and what follows from it."""
    gone = layout.constraints.followers(index)
    kept = [k for k in range(len(layout.rows)) if k not in gone]
    place = {old: new for new, old in enumerate(kept)}
    copies = tuple(
        Copied(place[copy.source], place[copy.index], copy.turn, copy.shift)
        for copy in layout.constraints.copies
        if copy.index in place and copy.source in place
    )
    astride = {place[k]: motions for k, motions in layout.constraints.astride.items() if k in place}
    rest = tuple((place[k], motions) for k, motions in alone if k in place)
    origin = tuple(layout.origin[k] for k in kept)
    return Layout(layout.rows[kept], Constraints(copies, astride), rest, origin)


def _shares(images: np.ndarray, bits: np.ndarray) -> np.ndarray:
    """IoU (images, parts) of what images (i, n) bool and parts (k, n) 0 or 1 hold.

    Counts below 2^24 are exact in float32: the product is the same however many cores take part.
    """
    held = images.astype(np.float32)
    common = held @ bits.T
    union = held.sum(1)[:, None] + bits.sum(1)[None] - common
    return common / np.maximum(union, 1.0)


def _is_there(image: np.ndarray, placed: list[np.ndarray]) -> bool:
    """True if an image coincides with another image of the same part."""
    return any(np.abs(image[:3] - other[:3]).max() < 1e-4 and _alike(image, other) for other in placed)


def _alike(image: np.ndarray, other: np.ndarray) -> bool:
    return abs(float(image[3:7].astype(np.float64) @ other[3:7])) > 0.999


def _same(a: Motion, b: Motion) -> bool:
    return bool(np.abs(a[0] - b[0]).max() < 1e-4 and np.abs(a[1] - b[1]).max() < 1e-4)
