"""Provenance that a page tells of its assembly: read from the report beside it, as plain sentences."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..assembly.plain_json import at, number_at
from ..assembly.report import read_report
from ..assembly.transform import up_axis

__all__ = ["at", "number_at", "read_report", "report_facts", "up_axis"]


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
