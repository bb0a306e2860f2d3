"""A static page of many fits: input beside assembly, numbers, the command that made each, and links to its own page.

All that comes from a file is put in as text. The page asks for nothing but the files beside it, and shows everything
without scripts too: those only search and sort.
"""

from __future__ import annotations

import html
import os
import re
import shutil
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from statistics import fmean, median
from typing import Any
from urllib.parse import quote

from ...assembly.atomic_write import write_bytes
from ...assembly.plain_json import at, number_at, read_bytes, text_at
from ...assembly.report import REPORT, read_report

PICTURE = (960, 360)
"""Width and height of a fit's two pictures, in pixels."""
QUALITY = 82
"""Of a WebP: a picture takes some 10 kB then, and shading still looks smooth."""

MAX_PICTURE_BYTES, MAX_PICTURE_PIXELS = 32 * 1024 * 1024, 16_000_000
"""Of a preview.png: it has 960 x 360 pixels, and a file may claim any number."""

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


BESIDE_REPORT = ("assembly.json", "history.npz", "parts.glb", "viewer.html")
"""Files of a fit that tell its report from those of other programs."""


def find_fits(folders: Sequence[Path]) -> list[Path]:
    """All folders of fits at or below these, in order of their paths: those with a report and something else of ours.

    Either may be damaged or gone: then there is something to say about the folder.
    """
    found = {path.parent for folder in folders for path in folder.rglob(REPORT)}
    return sorted(path for path in found if any(os.path.lexists(path / name) for name in BESIDE_REPORT))


def read_entry(folder: Path, command: Callable[[dict[str, Any]], str] = lambda report: "") -> Entry | None:
    """Read the report in a fit's folder; None if it is no report of a fit.

    Args:
        folder: of the fit.
        command: the command line of a report.
    """
    report = read_report(folder)
    if not report:
        return None
    parts, faces = number_at(report, "metrics", "primitive_count"), number_at(report, "input", "faces")
    return Entry(
        name=text_at(report, "input", "name") or folder.name.removesuffix(".resfit"),
        sha256=text_at(report, "input", "sha256"),
        folder=folder,
        preset=text_at(report, "options", "preset"),
        parts=None if parts is None else int(parts),
        iou=number_at(report, "metrics", "iou"),
        bisurf_iou=number_at(report, "metrics", "bisurf_iou"),
        seconds=number_at(report, "metrics", "wall_s"),
        faces=None if faces is None else int(faces),
        sentence=text_at(report, "input", "sentence"),
        closed=at(report, "input", "closed") is True,
        status=text_at(report, "status", "name"),
        command=command(report),
    )


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
        picture = thumbnail(entry.folder / "preview.png")
        if picture is not None:
            write_bytes(folder / "preview.webp", picture)
        cards.append(card(entry, f"{ITEMS}/{quote(item)}", picture is not None))
    parts = {
        "TITLE": html.escape(title),
        "SUMMARY": html.escape(summary(entries)),
        "STYLE": source("style.css"),
        "SCRIPT": source("script.js"),
        "CARDS": "\n".join(cards),
    }
    write_bytes(out / "index.html", filled(source("page.html"), parts).encode("utf-8", "replace"))
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


def thumbnail(preview: Path) -> bytes | None:
    """The preview as a small WebP file; None if there is none, it is damaged, or it is no picture of a usual size."""
    from PIL import Image

    buffer = BytesIO()
    try:
        content = read_bytes(preview, MAX_PICTURE_BYTES)
        # A PNG says its size first: pixels are unpacked only if they are not too many.
        width, height = struct.unpack(">II", content[16:24])
        if width * height > MAX_PICTURE_PIXELS:
            return None
        with Image.open(BytesIO(content), formats=["PNG"]) as picture:
            picture.convert("RGB").resize(PICTURE, Image.Resampling.LANCZOS).save(
                buffer, "WEBP", quality=QUALITY, method=5
            )
    except (OSError, ValueError, SyntaxError, EOFError, struct.error):
        return None
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
    """Summary of fits: how many there are and how good they are."""
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
    return files("resfit.eval.report").joinpath("gallery_page", name).read_text(encoding="utf-8").strip()
