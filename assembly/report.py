"""report.json of a fit's folder, as all that read it see it: checked once, and empty if it cannot be trusted."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from .plain_json import parse_plain, read_bytes

REPORT: Final = "report.json"
"""Its name: it is what makes a folder that of a fit."""

FORMAT: Final = "resfit-report"
"""What its `format` says."""

MAX_BYTES = 16 * 1024 * 1024


def read_report(folder: Path) -> dict[str, Any]:
    """The report of the fit in a folder; empty if there is none, or it is damaged or no report of a fit.

    Its numbers are finite, its texts Unicode, and it is not nested deeply; which fields it has is not checked.
    """
    try:
        report = parse_plain(read_bytes(folder / REPORT, MAX_BYTES))
    except (OSError, ValueError):
        return {}
    return report if isinstance(report, dict) and report.get("format") == FORMAT else {}
