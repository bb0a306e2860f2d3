"""Worth of an assembly's parts: by the report of the fit beside it, or by the volume each alone holds."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..kernels.contour.isosurface import tight_bounds
from ..kernels.field.evaluate import evaluate_primitives
from .assembly import Assembly
from .plain_json import number_at, text_at
from .report import read_report

RESOLUTION = 96
"""Cells along the longest side when volumes are counted."""

CHUNK = 1 << 16
"""Cells evaluated at once: 64 parts take 17 MB then."""


def part_worths(assembly: Assembly, path: str | Path | None = None, device: str = "auto") -> list[float]:
    """One number a part, the larger the more it would be missed.

    Args:
        assembly: the parts.
        path: the assembly.json that it was read from; gains are taken from a report.json beside it that names the same
            parts. Without one, volumes are counted.
        device: `auto`, `cpu`, `cuda:0`.
    """
    gains = None if path is None else _reported_gains(assembly, Path(path).parent)
    return exclusive_volumes(assembly, device) if gains is None else gains


def exclusive_volumes(assembly: Assembly, device: str = "auto") -> list[float]:
    """Volume that each part alone holds, cubed normalised units; parts hidden in others count by a trace of theirs."""
    primitives = assembly.on_device(device)
    count = len(assembly.primitives)
    if not count:
        return []
    lower, upper = (np.asarray(corner, np.float64) for corner in tight_bounds(primitives))
    step = float((upper - lower).max()) / RESOLUTION
    shape = np.maximum(1, np.ceil((upper - lower) / step)).astype(int)
    alone, held = np.zeros(count), np.zeros(count)
    total = int(shape.prod())
    for begin in range(0, total, CHUNK):
        cells = np.stack(np.unravel_index(np.arange(begin, min(begin + CHUNK, total)), tuple(shape)), axis=1)
        points = (lower + (cells + 0.5) * step).astype(np.float32)
        inside = evaluate_primitives(primitives, points) < 0
        held += inside.sum(axis=1)
        alone += inside[:, inside.sum(axis=0) == 1].sum(axis=1)
    # A millionth of the whole volume of a part settles who goes first among those that hold nothing alone.
    return [float(value) for value in (alone + 1e-6 * held) * step**3]


def _reported_gains(assembly: Assembly, folder: Path) -> list[float] | None:
    """The gains in the report of a fit's folder, None if there is none for these parts."""
    parts = read_report(folder).get("parts")
    if not isinstance(parts, list):
        return None
    gains = {text_at(part, "name"): number_at(part, "gain") for part in parts}
    found = [gains.get(part.name) for part in assembly.primitives]
    return None if None in found else [float(gain) for gain in found if gain is not None]
