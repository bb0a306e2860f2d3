"""Kernel profile of a fit: launches and seconds of each, counted while a bundled mesh is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import as_file, files

import warp as wp

from ...fitter.config import preset_config
from ...fitter.search.multi_start import fit_target
from ...kernels.runtime.launch import profiled
from ...shape.target import make_target
from .harness import cores

LEAST_SHARE = 0.01
"""Of a fit's time; what takes less is summed up."""


@dataclass(frozen=True)
class KernelShare:
    """A kernel's part in a fit, on one core."""

    kernel: str
    launches: int
    seconds: float
    share: float
    """Of the time in all kernels."""


def measure_shares(device: wp.Device, preset: str = "balanced") -> list[KernelShare]:
    """Every kernel of a fit of the bundled cactus with more than LEAST_SHARE, most first, and the others as one."""
    config = preset_config(preset)
    with as_file(files("resfit.data") / "potted_cactus.glb") as mesh, cores(1):
        fit_target(make_target(mesh, device), preset_config("fast", rounds=1), device)
        with profiled() as usage:
            fit_target(make_target(mesh, device), config, device)
    total = sum(entry.seconds for entry in usage.values())
    rows = [
        KernelShare(name, entry.launches, entry.seconds, entry.seconds / total)
        for name, entry in sorted(usage.items(), key=lambda item: -item[1].seconds)
    ]
    shown = [row for row in rows if row.share >= LEAST_SHARE]
    rest = [row for row in rows if row.share < LEAST_SHARE]
    launches, seconds = sum(row.launches for row in rest), sum(row.seconds for row in rest)
    return [*shown, KernelShare(f"{len(rest)} others", launches, seconds, seconds / total)]


def shares_table(rows: Sequence[KernelShare]) -> str:
    """The rows as a section of a Markdown page."""
    seconds, launches = sum(row.seconds for row in rows), sum(row.launches for row in rows)
    lines = [
        "",
        "## What a fit launches",
        "",
        "The preset balanced on the bundled cactus, reading and rounds, on one core:",
        f"{seconds:.2f} s in {launches:,} launches. On a GPU these are times of the host.",
        "",
        "| kernel | launches | seconds | share |",
        "|---|---|---|---|",
    ]
    lines += [
        f"| {row.kernel} | {row.launches:,} | {row.seconds:.3f} | {100 * row.share:.1f} % |" for row in rows
    ]
    return "\n".join(lines) + "\n"
