"""A picture of many fits: each input beside its assembly, name and numbers below."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from ...assembly.atomic_write import write_bytes

COLUMNS = 4
PANEL = (480, 180)
"""Width and height of a fit's two pictures, in pixels."""
CAPTION = 40
"""Height of two lines of text."""
GAP = 8
PAPER, INK, FAINT = (255, 255, 255), (30, 34, 40), (110, 116, 124)
COLORS = 256
"""Of the whole picture: a palette makes the file a third as large, and shading still looks smooth."""


def draw_sheet(rows: Sequence[dict[str, Any]], work: Path, path: Path, columns: int = COLUMNS) -> None:
    """Write the contact sheet.

    Args:
        rows: of `results.run_all`.
        work: folder with the fits' folders, MESH.resfit each.
        path: the PNG file.
        columns: fits side by side.
    """
    from PIL import Image, ImageDraw

    columns = min(columns, len(rows))
    lines = -(-len(rows) // columns)
    width, height = columns * (PANEL[0] + GAP) + GAP, lines * (PANEL[1] + CAPTION + GAP) + GAP
    sheet = Image.new("RGB", (width, height), PAPER)
    draw = ImageDraw.Draw(sheet)
    for index, row in enumerate(rows):
        left = GAP + (index % columns) * (PANEL[0] + GAP)
        top = GAP + (index // columns) * (PANEL[1] + CAPTION + GAP)
        _draw_fit(sheet, draw, row, work / f"{row['mesh']}.resfit" / "preview.png", left, top)
    buffer = BytesIO()
    quantized = sheet.quantize(COLORS, dither=Image.Dither.NONE)
    quantized.save(buffer, "PNG", optimize=True)
    write_bytes(path, buffer.getvalue())


def _draw_fit(sheet: Any, draw: Any, row: dict[str, Any], preview: Path, left: int, top: int) -> None:
    from PIL import Image, ImageFont

    name_font, small = ImageFont.load_default(15), ImageFont.load_default(12)
    if "error" in row:
        draw.rectangle((left, top, left + PANEL[0], top + PANEL[1]), fill=(242, 243, 245))
        numbers = f"exit code {row['exit_code']}: {row['error']}"
    else:
        with Image.open(preview) as picture:
            sheet.paste(picture.convert("RGB").resize(PANEL, Image.Resampling.LANCZOS), (left, top))
        closed = "" if row["closed"] else ", open mesh"
        numbers = f"IoU {row['iou']:.3f}, {row['primitive_count']} parts, {row['cpu_s']:.1f} CPU s{closed}"
    draw.text((left + 2, top + PANEL[1] + 2), row["mesh"], fill=INK, font=name_font)
    while draw.textlength(numbers, font=small) > PANEL[0] - 4:
        numbers = numbers[:-2].rstrip() + "…" if not numbers.endswith("…") else numbers[:-3].rstrip() + "…"
    draw.text((left + 2, top + PANEL[1] + 21), numbers, fill=FAINT, font=small)
