"""What a page says about where its assembly came from: read from the report beside it, as plain sentences."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

Z_UP_SUFFIXES = (".stl", ".3mf", ".off", ".step", ".stp")
"""Formats of CAD, where z points up; in glTF and most others it is y. Only pictures depend on it."""

MAX_REPORT_BYTES = 16 * 1024 * 1024


def up_axis(name: str) -> Literal["y", "z"]:
    """The axis that points up in pictures, by the name of the input's file."""
    return "z" if name.lower().endswith(Z_UP_SUFFIXES) else "y"


def read_report(folder: Path) -> dict[str, Any]:
    """The report.json of a fit in a folder; empty if there is none that can be read."""
    path = folder / "report.json"
    try:
        if path.stat().st_size > MAX_REPORT_BYTES:
            return {}
        report = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return report if isinstance(report, dict) else {}


def report_facts(report: Mapping[str, Any]) -> list[str]:
    """Short sentences: how good the fit was, what was fitted, by what. Whatever the report lacks is left out."""
    iou, p95 = number_at(report, "metrics", "iou"), number_at(report, "deviation", "p95")
    quality = [] if iou is None else [f"IoU {iou:.3f} as fitted"]
    quality += [] if p95 is None else [f"95 % of the surface within {p95:.3g}"]
    name, faces = at(report, "input", "name"), number_at(report, "input", "faces")
    version, preset = at(report, "resfit"), at(report, "options", "preset")
    origin = [f"fitted to {name}"] if isinstance(name, str) else []
    origin += [f"({faces:,.0f} faces)"] if origin and faces is not None else []
    origin += [f"by resfit {version}"] if isinstance(version, str) else []
    origin += [f"--preset {preset}"] if isinstance(preset, str) else []
    facts = [", ".join(quality), " ".join(origin)]
    return [fact for fact in facts if fact]


def at(report: Mapping[str, Any], *keys: str) -> Any:
    """What lies at a path of keys; None if there is nothing."""
    found: Any = report
    for key in keys:
        found = found.get(key) if isinstance(found, Mapping) else None
    return found


def number_at(report: Mapping[str, Any], *keys: str) -> float | None:
    """A number at a path of keys; None if there is none."""
    found = at(report, *keys)
    return found if isinstance(found, int | float) and not isinstance(found, bool) else None
