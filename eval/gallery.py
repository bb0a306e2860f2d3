"""A static page of many fits: input beside assembly, numbers, the command that made each, and links to its own page.

All that comes from a file is put in as text. The page asks for nothing but the files beside it, and shows everything
without scripts too: those only search and sort.
"""

from __future__ import annotations

import html
import json
import re
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from statistics import fmean, median
from typing import Any
from urllib.parse import quote

from ..assembly.atomic_write import write_bytes

PICTURE = (960, 360)
"""Width and height of a fit's two pictures, in pixels."""
QUALITY = 82
"""Of a WebP: a picture takes some 10 kB then, and shading still looks smooth."""

MAX_REPORT_BYTES = 16 * 1024 * 1024

STOPPED_EARLY = ("timeout", "interrupted")
"""What `status` says of fits that are less than what was asked for."""

ITEMS = "fits"
"""Folder of the gallery that has a folder for each fit."""


@dataclass(frozen=True)
class Entry:
    """A fit as the gallery shows it; what is not known is None or empty."""

    name: str
    """Of the mesh's file."""
    sha256: str
    """Of the input."""
    folder: Path
    """Of the fit."""
    preset: str
    parts: int | None
    iou: float | None
    bisurf_iou: float | None
    seconds: float | None
    """Wall time."""
    faces: int | None
    sentence: str
    """What the input was taken for."""
    closed: bool
    status: str
    """Why the fit stopped, in one word."""
    command: str = ""
    """That makes it again."""


def find_fits(folders: Sequence[Path]) -> list[Path]:
    """All folders of fits at or below these, in order of their paths: those with a report and an assembly."""
    found = {path.parent for folder in folders for path in folder.rglob("report.json")}
    return sorted(path for path in found if (path / "assembly.json").is_file())


def read_entry(folder: Path, command: Callable[[dict[str, Any]], str] = lambda report: "") -> Entry | None:
    """What the report in a fit's folder says; None if it is no report of a fit.

    Args:
        folder: of the fit.
        command: the command line of a report.
    """
    path = folder / "report.json"
    try:
        if path.stat().st_size > MAX_REPORT_BYTES:
            return None
        report = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(report, dict) or report.get("format") != "resfit-report":
        return None
    found, metrics, status = (_section(report, name) for name in ("input", "metrics", "status"))
    parts, faces = (
        _number(section.get(name)) for section, name in ((metrics, "primitive_count"), (found, "faces"))
    )
    return Entry(
        name=_text(found.get("name")) or folder.name.removesuffix(".resfit"),
        sha256=_text(found.get("sha256")),
        folder=folder,
        preset=_text(_section(report, "options").get("preset")),
        parts=None if parts is None else int(parts),
        iou=_number(metrics.get("iou")),
        bisurf_iou=_number(metrics.get("bisurf_iou")),
        seconds=_number(metrics.get("wall_s")),
        faces=None if faces is None else int(faces),
        sentence=_text(found.get("sentence")),
        closed=found.get("closed") is True,
        status=_text(status.get("name")),
        command=command(report),
    )


def _section(report: dict[str, Any], name: str) -> dict[str, Any]:
    section = report.get(name)
    return section if isinstance(section, dict) else {}


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def _text(value: Any) -> str:
    return value if isinstance(value, str) else ""


def write_gallery(
    entries: Sequence[Entry], out: Path, write_page: Callable[[Entry, Path], None], title: str = "Fits"
) -> Path:
    """Write the gallery: index.html, and a folder for each fit with what the page links to.

    Args:
        entries: the fits.
        out: folder of the gallery; files of an earlier one that have the same names are replaced.
        write_page: writes the page of a fit that has none.
        title: of the page.

    Returns:
        The page.
    """
    out.mkdir(parents=True, exist_ok=True)
    cards = []
    for entry, item in zip(entries, item_names(entries), strict=True):
        folder = out / ITEMS / item
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(entry.folder / "assembly.json", folder / "assembly.json")
        if (entry.folder / "viewer.html").is_file():
            shutil.copyfile(entry.folder / "viewer.html", folder / "viewer.html")
        else:
            write_page(entry, folder / "viewer.html")
        preview = entry.folder / "preview.png"
        if preview.is_file():
            write_bytes(folder / "preview.webp", thumbnail(preview))
        cards.append(card(entry, f"{ITEMS}/{quote(item)}", preview.is_file()))
    parts = {
        "TITLE": html.escape(title),
        "SUMMARY": html.escape(summary(entries)),
        "STYLE": source("style.css"),
        "SCRIPT": source("script.js"),
        "CARDS": "\n".join(cards),
    }
    write_bytes(out / "index.html", filled(source("page.html"), parts).encode())
    return out / "index.html"


def item_names(entries: Sequence[Entry]) -> list[str]:
    """A name for each fit's folder, of plain letters only, and none twice on a file system that ignores case."""
    taken: set[str] = set()
    names = []
    for entry in entries:
        stem = re.sub(r"[^A-Za-z0-9._-]+", "_", entry.name).strip("._")[:80] or "fit"
        name, count = stem, 1
        while name.lower() in taken:
            count += 1
            name = f"{stem}-{count}"
        taken.add(name.lower())
        names.append(name)
    return names


def thumbnail(preview: Path) -> bytes:
    """The preview as a small WebP file."""
    from PIL import Image

    buffer = BytesIO()
    with Image.open(preview) as picture:
        picture.convert("RGB").resize(PICTURE, Image.Resampling.LANCZOS).save(
            buffer, "WEBP", quality=QUALITY, method=5
        )
    return buffer.getvalue()


def card(entry: Entry, item: str, has_picture: bool) -> str:
    """A fit as HTML; `item` is its folder as part of an address."""
    name = html.escape(entry.name)
    numbers = [
        None if entry.parts is None else f"<b>{entry.parts}</b> {'part' if entry.parts == 1 else 'parts'}",
        None if entry.iou is None else f"IoU <b>{entry.iou:.3f}</b>",
        None if entry.bisurf_iou is None else f"BiSurfIoU <b>{entry.bisurf_iou:.3f}</b>",
        None if entry.seconds is None else f"{entry.seconds:.1f} s",
        None if entry.faces is None else f"{entry.faces:,} faces",
        "stopped early" if entry.status in STOPPED_EARLY else None,
    ]
    width, height = PICTURE
    picture = '<span class="blank">no picture</span>'
    if has_picture:
        size = f'width="{width}" height="{height}" loading="lazy"'
        picture = f'<img src="{item}/preview.webp" {size} alt="{name} beside its assembly">'
    return filled(
        source("card.html"),
        {
            "NAME": name,
            "ITEM": item,
            "PICTURE": picture,
            "NUMBERS": " · ".join(text for text in numbers if text),
            "SENTENCE": html.escape(entry.sentence),
            "COMMAND": html.escape(entry.command),
            "HIDDEN": "" if entry.command else "hidden",
            # Where there is no number, it sorts last.
            "PARTS": "" if entry.parts is None else str(entry.parts),
            "IOU": "" if entry.iou is None else f"{entry.iou:.6f}",
            "SECONDS": "" if entry.seconds is None else f"{entry.seconds:.3f}",
        },
    )


def summary(entries: Sequence[Entry]) -> str:
    """How many fits there are and how good they are."""
    texts = [f"{len(entries)} {'fit' if len(entries) == 1 else 'fits'}"]
    closed = [entry.iou for entry in entries if entry.iou is not None and entry.closed]
    if closed:
        texts.append(f"mean IoU {fmean(closed):.3f} of {len(closed)} closed meshes")
    parts = [entry.parts for entry in entries if entry.parts is not None]
    if parts:
        texts.append(f"median {median(parts):g} parts")
    return ", ".join(texts)


def filled(template: str, parts: dict[str, str]) -> str:
    """The template with each {{NAME}} replaced, all at once, so that nothing put in is looked at again."""
    return re.sub(r"\{\{([A-Z]+)\}\}", lambda found: parts[found[1]], template)


def source(name: str) -> str:
    """A file of `gallery_page/`, which lies in this package."""
    return files("resfit.eval").joinpath("gallery_page", name).read_text(encoding="utf-8").strip()
