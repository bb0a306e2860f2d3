"""Everything that a comparison leaves behind for people: tables, plot and pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...assembly.atomic_write import write_bytes
from ..batch.datasets import Shape
from .plot import pareto_svg
from .sheet import write_sheet
from .tables import latex, markdown

FILES = ("tables.md", "tables.tex", "pareto.svg", "sheet.png")


def write_report(rows: Sequence[dict[str, Any]], shapes: Sequence[Shape], out: Path) -> None:
    """Write FILES.

    Args:
        rows: of the comparison.
        shapes: its meshes.
        out: the folder of the comparison.
    """
    tables, tex, plot, sheet = (out / name for name in FILES)
    write_bytes(tables, markdown(rows).encode())
    write_bytes(tex, latex(rows).encode())
    write_bytes(plot, pareto_svg(rows).encode())
    write_sheet(rows, shapes, out, sheet)
