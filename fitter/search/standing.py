"""Fitting a slanted target in its own frame: it is turned so that it stands straight, fitted, and turned back.

Grids know three axes. What has flat faces along three axes of its own is cut into slabs, boxes and rings only where
these are the grid's; a box with a floor comes back as two parts upright, and as six when it is turned.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp

from ...assembly.change_of_frame import rescale_rows
from ...shape.manhattan_frame import manhattan_frame
from ...shape.parts import solid_target
from ...shape.target import Target
from ..config import FitConfig
from ..objective.cached import CachedObjective
from ..outcome import Outcome, Round
from ..progress import Progress
from ..regularise.rigid_motion import move_rows
from .multi_start import fit_target


@dataclass(frozen=True)
class Standing:
    """A slanted target that was turned."""

    target: Target
    """Turned; its `transform` has the scale to mesh units, and no translation of use."""
    rotation: np.ndarray
    """(3, 3): with `scale` and `offset` it takes the slanted frame to the standing one."""
    scale: float
    """Standing units times this are slanted ones."""
    offset: np.ndarray
    """(3,) where the standing frame's origin is, before it is turned back, slanted units."""

    family: str
    """Of all rows."""

    def back(self, rows: np.ndarray) -> np.ndarray:
        """Rows (k, ROW) of the standing frame in the slanted one."""
        scaled = rescale_rows(rows, [self.family] * len(rows), self.scale, self.offset)
        return move_rows(scaled, self.rotation.T, np.zeros(3), np.zeros(3))

    def forth(self, rows: np.ndarray) -> np.ndarray:
        """Rows (k, ROW) of the slanted frame in the standing one."""
        turned = move_rows(rows, self.rotation, np.zeros(3), np.zeros(3))
        return rescale_rows(turned, [self.family] * len(rows), 1.0 / self.scale, -self.offset / self.scale)

    def back_round(self, entry: Round) -> Round:
        """A round in the slanted frame."""
        return replace(
            entry,
            regions=[self.back_box(region) for region in entry.regions],
            candidates=self.back(entry.candidates),
            chosen=self.back(entry.chosen),
            refined=self.back(entry.refined),
            kept=self.back(entry.kept),
        )

    def back_box(self, region: dict[str, Any]) -> dict[str, Any]:
        """A region's description, its box that around the turned one."""
        if "lower" not in region:
            return region
        count = region["resolution"]
        ends = np.stack([region["lower"], region["upper"]]).astype(np.float64) * (2.0 / count) - 1.0
        corners = np.stack(np.meshgrid(*ends.T, indexing="ij"), axis=-1).reshape(-1, 3)
        turned = (self.scale * corners + self.offset) @ self.rotation
        cells = (turned + 1.0) * (0.5 * count)
        lower = np.clip(np.floor(cells.min(axis=0)), 0, count - 1).astype(int)
        upper = np.clip(np.ceil(cells.max(axis=0)), lower + 1, count).astype(int)
        return {**region, "lower": lower.tolist(), "upper": upper.tolist()}


def stand(target: Target, config: FitConfig, device: wp.Device) -> Standing | None:
    """A target turned to its Manhattan frame; None if it has none, or stands straight."""
    solid = target.solid
    faces = np.concatenate([solid.boundary_faces, solid.sheet_faces])
    rotation = manhattan_frame(solid.vertices, faces)
    if rotation is None:
        return None
    turned = solid_target(
        replace(solid, vertices=solid.vertices @ rotation.T),
        target.vertices @ rotation.T,
        target.faces,
        target,
        device,
        target.resolution,
        config.samples,
        config.seed,
    )
    motion = turned.transform
    mesh_scale = replace(motion, scale=motion.scale * target.transform.scale)
    offset = np.asarray(motion.translation)
    return Standing(replace(turned, transform=mesh_scale), rotation, motion.scale, offset, config.primitive)


def fit_standing(
    target: Target,
    config: FitConfig,
    device: wp.Device,
    on_progress: Callable[[Progress], None] | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    start_rows: np.ndarray | None = None,
) -> Outcome:
    """`fit_target` in the frame in which the target stands straight; all rows are in the target's own."""
    begin = time.perf_counter()
    standing = stand(target, config, device)
    if standing is None:
        return fit_target(target, config, device, on_progress, should_stop, start_rows)
    spent = time.perf_counter() - begin
    if config.timeout:
        config = replace(config, timeout=max(1e-9, config.timeout - spent))

    def tell(progress: Progress) -> None:
        if on_progress is not None:
            rows = None if progress.rows is None else standing.back(progress.rows)
            on_progress(replace(progress, rows=rows))

    start = None if start_rows is None else standing.forth(start_rows)
    found = fit_target(standing.target, config, device, tell, should_stop, start)
    rows = standing.back(found.rows)
    return replace(
        found,
        rows=rows,
        score=CachedObjective(target, config, device).score(rows),
        rounds=[standing.back_round(entry) for entry in found.rounds],
        timings={"stand": spent, **found.timings},
    )
