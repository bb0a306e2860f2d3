"""Rows of fits as Markdown: means over closed meshes, the worst ones by name, what each mesh was taken for."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from statistics import fmean, median
from typing import Any

from ...assembly.atomic_write import write_bytes

WORST, WORST_OPEN = 5, 3
"""Closed and open meshes that are named and shown as the worst."""

COLUMNS: tuple[tuple[str, str, str], ...] = (
    ("IoU", "iou", ".3f"),
    ("95 % within, % of size", "deviation", ".2%"),
    ("parts", "primitive_count", "d"),
    ("overlap", "overlap", ".3f"),
    ("unoverlap", "unoverlap", ".3f"),
    ("CPU s", "cpu_s", ".1f"),
    ("wall s", "wall_s", ".1f"),
    ("peak MB", "peak_mb", ".0f"),
)
"""Heading, key of a row, format."""


def write_table(rows: Sequence[dict[str, Any]], path: Path, preset: str) -> None:
    """Write results.md.

    Args:
        rows: of `results.run_all`.
        path: the file.
        preset: that they were fitted with.
    """
    fitted = [row for row in rows if "error" not in row]
    closed = [row for row in fitted if row["closed"]]
    lines = ["# Fits", "", _introduction(rows, preset), ""]
    if closed:
        lines += [*_summary(closed), ""]
    lines += [*_worst_section(rows), "## Closed meshes", "", *_table(closed), ""]
    lines += [
        "## Open meshes",
        "",
        "Made solid first; a thick shell is easy to match, so look at the distance and not at the IoU.",
        "",
        *_table([row for row in fitted if not row["closed"]]),
        "",
    ]
    refused = [row for row in rows if "error" in row]
    if refused:
        lines += ["## Not fitted", ""]
        lines += [f"- {row['mesh']}: exit code {row['exit_code']}, {row['error']}" for row in refused] + [""]
    lines += ["## What each mesh was taken for", ""]
    lines += [f"- {row['mesh']}: {' '.join([row['sentence'], *row['notes']])}" for row in fitted]
    write_bytes(path, ("\n".join(lines) + "\n").encode())


def worst_rows(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The closed meshes of the lowest IoU, then the open ones of the largest distance, each from the worst."""
    fitted = [row for row in rows if "error" not in row]
    closed = sorted((row for row in fitted if row["closed"]), key=lambda row: row["iou"])
    left_open = [row for row in fitted if not row["closed"]]
    # One without a surface has no distance: nothing is worse.
    left_open.sort(key=lambda row: -float("inf") if row["deviation"] is None else -row["deviation"])
    return closed[:WORST] + left_open[:WORST_OPEN]


def _worst_section(rows: Sequence[dict[str, Any]]) -> list[str]:
    found = worst_rows(rows)
    if not found:
        return []
    lines = ["## The worst", "", "![each input beside its fit](worst.png)", ""]
    for row in found:
        distance = (
            "no surface" if row["deviation"] is None else f"95 % within {row['deviation']:.2%} of the size"
        )
        figures = (
            [f"IoU {row['iou']:.3f}", distance] if row["closed"] else [distance, f"IoU {row['iou']:.3f}"]
        )
        shown = ", ".join([*figures, f"{row['primitive_count']} parts"])
        lines.append(f"- {row['mesh']} ({'closed' if row['closed'] else 'open'}): {shown}; {row['status']}.")
    return [*lines, ""]


def _introduction(rows: Sequence[dict[str, Any]], preset: str) -> str:
    machines = sorted(
        {f"{row['machine']['device']}, {row['machine']['cores']} cores" for row in rows if "machine" in row}
    )
    return (
        f"Written by `python -m resfit.eval.report.results` (`make results`): {len(rows)} meshes, preset {preset},"
        f" resfit {version('resfit')}, {' and '.join(machines) or 'no machine'}. Seconds are those of whole processes"
        " with compiled kernels; the size of a mesh is its longest side. All pictures: [results.png](results.png)."
    )


def _summary(closed: Sequence[dict[str, Any]]) -> list[str]:
    def mean(key: str) -> float:
        return fmean(row[key] for row in closed)

    lowest = min(row["iou"] for row in closed)
    middle = median(row["iou"] for row in closed)
    return [
        f"**Closed meshes ({len(closed)}):** mean IoU {mean('iou'):.3f}, median {middle:.3f}, worst"
        f" {lowest:.3f}; {mean('primitive_count'):.1f} parts, overlap {mean('overlap'):.3f}, unoverlap"
        f" {mean('unoverlap'):.3f}; {mean('cpu_s'):.1f} CPU s, {mean('wall_s'):.1f} s,"
        f" {max(row['peak_mb'] for row in closed):.0f} MB at most."
    ]


def _table(rows: Sequence[dict[str, Any]]) -> list[str]:
    if not rows:
        return ["None."]
    headings = ["mesh", "faces", *(heading for heading, _, _ in COLUMNS), "stopped because"]
    lines = ["| " + " | ".join(headings) + " |", "|---" * len(headings) + "|"]
    for row in rows:
        cells = [row["mesh"], f"{row['faces']}"]
        cells += ["-" if row[key] is None else format(row[key], style) for _, key, style in COLUMNS]
        lines.append("| " + " | ".join([*cells, row["status"]]) + " |")
    return lines
