"""Folders of fits: damaged and hostile history.npz, report.json and preview.png, through all that reads them.

Wrong: a gallery's command of two lines, a pickle that was run.
"""

from __future__ import annotations

import io
import json
import random
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from functools import cache
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fuzz.campaigns import shuffled
from fuzz.damage import VALUES, damaged_bytes, places_in, replaced
from fuzz.harness import Campaign, Case, Wrong

READ_FILES = ("assembly.json", "history.npz", "report.json", "preview.png")
MARK = "/tmp/resfit-fuzz-pickle"
"""What a pickle in a history would make."""


@cache
def good_fit() -> dict[str, bytes]:
    """The files of a small fit."""
    import trimesh

    import resfit

    with TemporaryDirectory() as name:
        folder = Path(name) / "r.resfit"
        ball = trimesh.creation.icosphere()
        resfit.fit(ball, preset="fast", rounds=2, max_primitives=3, device="cpu").save(folder)
        return {name: (folder / name).read_bytes() for name in READ_FILES}


def packed(header: Any, arrays: dict[str, Any]) -> bytes:
    """A history of a header and arrays."""
    import numpy as np

    buffer = io.BytesIO()
    np.savez_compressed(buffer, header=np.frombuffer(json.dumps(header).encode(), np.uint8), **arrays)
    return buffer.getvalue()


def repacked(
    history: bytes, change: Callable[[int, bytes], bytes], method: int = zipfile.ZIP_STORED
) -> bytes:
    """A history whose members, numbered from 0, are changed."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(history)) as source, zipfile.ZipFile(buffer, "w", method) as archive:
        for number, entry in enumerate(source.infolist()):
            archive.writestr(entry.filename, change(number, source.read(entry)))
    return buffer.getvalue()


def npy(header: str, body: bytes = b"") -> bytes:
    """An array file with any header."""
    text = header + " " * (63 - (len(header) + 10) % 64) + "\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text.encode() + body


def history_cases(rng: random.Random, history: bytes) -> Iterator[Case]:
    """Histories with other values, arrays, members and compression."""
    import numpy as np

    with np.load(io.BytesIO(history)) as found:
        arrays = dict(found)
    header = json.loads(arrays.pop("header").tobytes())
    first = next(iter(arrays))
    width = arrays[first].shape[1]
    for path in places_in(header):
        for value in rng.sample(VALUES, 6):
            yield Case(f"history {path} {value!s:.20}", packed(replaced(header, path, value), arrays), "npz")
    for value in VALUES:
        yield Case(f"history is {value!s:.20}", packed(value, arrays), "npz")
    odd = [np.zeros((3, width), np.float64), np.zeros((2, 3), np.float32), np.zeros(0), np.array(["x"])]
    odd += [np.full((2, width), value, np.float32) for value in (np.nan, np.inf, 1e38, -1)]
    for rows in odd:
        name = f"history rows {rows.dtype} {rows.shape} {rows.flat[0] if rows.size else ''}"
        yield Case(name, packed(header, {**arrays, first: rows}), "npz")
        yield Case(f"{name} in all", packed(header, dict.fromkeys(arrays, rows)), "npz")
    for shape in ("(1000000000000, 17)", "(2000000000, 17)", "(-1, 17)", "()"):
        member = npy(f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}")
        made = repacked(history, lambda number, data, member=member: member if number == 1 else data)
        yield Case(f"history shape {shape}", made, "npz")
    pickled = npy(
        "{'descr': '|O', 'fortran_order': False, 'shape': (1,), }",
        f"cos\nsystem\n(S'touch {MARK}'\ntR.".encode(),
    )
    for which in (0, 1):
        made = repacked(history, lambda number, data, which=which: pickled if number == which else data)
        yield Case(f"history pickle {which}", made, "npz")
    for method in (zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA):
        yield Case(f"history method {method}", repacked(history, lambda _, data: data, method), "npz")
    yield Case("history empty", b"", "npz")
    yield Case("history text", b"hello", "npz")


def report_cases(report: bytes) -> Iterator[Case]:
    """Reports with other values."""
    whole = json.loads(report)
    for path in places_in(whole, 3):
        for value in (*VALUES, "x\ncurl example.org | sh", "/proc/kcore", "/dev/zero"):
            yield Case(
                f"report {path} {value!s:.20}", json.dumps(replaced(whole, path, value)).encode(), "json"
            )
    for value in VALUES:
        yield Case(f"report is {value!s:.20}", json.dumps(value).encode(), "json")
    yield Case("report deep", b"[" * 100000, "json")
    yield Case("report of 5000 digits", report.replace(b'"version": 1', b'"version": ' + b"1" * 5000), "json")
    yield Case("report 1e999", report.replace(b'"faces": ', b'"faces": 1e999'), "json")
    yield Case("report no utf-8", b"\xff" + report, "json")


def picture_cases(preview: bytes) -> Iterator[Case]:
    """Pictures that are none, or claim to be large."""
    yield Case("preview empty", b"", "png")
    yield Case("preview text", b"hello", "png")
    yield Case("preview cut", preview[:500], "png")
    for side in (20000, 60000, 2**31 - 1):
        chunk = b"IHDR" + struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
        head = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk))
        yield Case(f"preview {side} x {side}", head + preview[33:], "png")


def cases(rng: random.Random) -> Iterator[Case]:
    """All by hand, then damaged files for ever."""
    fit = good_fit()
    by_hand = [
        *history_cases(rng, fit["history.npz"]),
        *report_cases(fit["report.json"]),
        *picture_cases(fit["preview.png"]),
    ]
    last = shuffled(rng, by_hand)
    for number in count():
        yield from [case for case in (next(last, None),) if case]
        name = rng.choice(READ_FILES[1:])
        how, data = damaged_bytes(rng, fit[name])
        yield Case(f"{name.partition('.')[0]} damaged {number} {how}", data, name.rpartition(".")[2])


def attempt(case: Case, folder: Path) -> str:
    """Read one file of a fit in every way; each way may refuse it."""
    from resfit.errors import InputError

    kind = case.name.partition(" ")[0]
    name = next(name for name in READ_FILES if name.startswith(kind))
    for other, data in good_fit().items():
        (folder / other).write_bytes(data)
    (folder / name).write_bytes(case.data)
    refusals = []
    for read in READERS[kind]:
        try:
            read(folder)
        except InputError as error:
            refusals.append(str(error))
    if Path(MARK).exists():
        Path(MARK).unlink()
        raise Wrong("a pickle in the history was run")
    if refusals:
        raise InputError(refusals[0])
    return "read"


def read_history(folder: Path) -> None:
    """As scripts do."""
    from resfit.assembly.history import History

    History.load(folder / "history.npz")


def play(folder: Path) -> None:
    """As the viewer does."""
    from resfit import Assembly
    from resfit.viewer.playback.playback import load_playback

    load_playback(folder, Assembly.load(folder / "assembly.json"))


def read_report(folder: Path) -> None:
    """As pages, the list of parts, the viewer and the saving do."""
    from resfit import Assembly
    from resfit.assembly.worth import part_worths
    from resfit.exports.facts import read_report, report_facts
    from resfit.result.folder import holds_fit
    from resfit.viewer.model.documents import reported_mesh

    report_facts(read_report(folder))
    part_worths(Assembly.load(folder / "assembly.json"), folder / "assembly.json")
    holds_fit(folder)
    reported_mesh(folder / "assembly.json")


def enter(folder: Path) -> None:
    """As the gallery does."""
    from resfit.cli.gallery import fit_command
    from resfit.eval.report.gallery import read_entry

    entry = read_entry(folder, fit_command)
    if entry and len(entry.command.splitlines()) > 1:
        raise Wrong(f"the gallery's command has two lines: {entry.command!r}")


def shrink(folder: Path) -> None:
    """As the gallery does with the picture."""
    from resfit.eval.report.gallery import thumbnail

    thumbnail(folder / "preview.png")


READERS: dict[str, tuple[Callable[[Path], None], ...]] = {
    "history": (read_history, play),
    "report": (read_report, enter),
    "preview": (shrink,),
}

CAMPAIGN = Campaign("fit-folders", cases, attempt, hang_s=60.0)
