"""The story of a fit, round by round: what was tried, chosen, refined and kept. history.npz in a fit's folder.

The fitter fills it, players show it. Only arrays and one JSON text are in the file: loading it runs no code.
"""

from __future__ import annotations

import json
import math
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from resfit.errors import AssemblyError

from ..kernels.primitives import FAMILIES
from ..kernels.rows import ROW
from .atomic_write import write_bytes
from .plain_json import is_number, parse_plain
from .primitive import shown
from .transform import Transform

FORMAT = "resfit-history"
VERSION = 1
STEPS = ("candidates", "chosen", "refined", "kept")
"""The row arrays of a round, in the order in which they come about."""

MAX_CELLS = 1000
"""Sides of the grid that the corners of a region's box may be away from it: no picture shows what is farther."""

MAX_BYTES = 256 * 1024 * 1024
"""Unpacked. A thousand candidates a round are 68 kB: a larger file is something else."""


@dataclass(frozen=True)
class HistoryRound:
    """One round. Rows are (count, ROW) float32 of `kernels/rows.py`, normalised frame, blends included."""

    regions: tuple[Mapping[str, Any], ...]
    """What each region was, as JSON values: source, volume, box in cells."""
    candidates: np.ndarray
    """Primitives that were proposed for the regions."""
    chosen: np.ndarray
    """Those of them, and of the ones kept so far, that were selected."""
    refined: np.ndarray
    """The chosen ones after joint refinement."""
    kept: np.ndarray
    """The refined ones that pruning left."""
    score: Mapping[str, float]
    """The objective of `kept` and its parts."""
    accepted: bool
    """Whether `kept` became the best so far."""


@dataclass(frozen=True)
class History:
    """All rounds of a fit."""

    family: str
    """Family of every row."""
    transform: Transform
    """mesh = scale * normalised + translation."""
    rounds: tuple[HistoryRound, ...] = ()

    def save(self, path: str | Path) -> None:
        """Write a history.npz, at once; a history always gives the same bytes.

        Raises:
            InputError: if the file cannot be written.
        """
        header = {
            "format": FORMAT,
            "version": VERSION,
            "family": self.family,
            "transform": asdict(self.transform),
            "rounds": [
                {
                    "regions": [dict(region) for region in entry.regions],
                    "score": dict(entry.score),
                    "accepted": entry.accepted,
                }
                for entry in self.rounds
            ],
        }
        arrays = {
            _key(number, step): np.asarray(getattr(entry, step), np.float32).reshape(-1, ROW)
            for number, entry in enumerate(self.rounds)
            for step in STEPS
        }
        text = np.frombuffer(json.dumps(header).encode(), np.uint8)
        buffer = BytesIO()
        np.savez_compressed(buffer, allow_pickle=False, header=text, **arrays)
        write_bytes(path, buffer.getvalue())

    @classmethod
    def load(cls, path: str | Path) -> History:
        """Read a history.npz.

        Raises:
            AssemblyError: if it cannot be read or is none: one sentence that names the file.
        """
        try:
            header, arrays = _read(path)
            return _from_header(header, arrays)
        except OSError as error:
            raise AssemblyError(f"cannot read {path}: {error.strerror or 'it is damaged'}.") from error
        except (ValueError, KeyError, TypeError, EOFError, AttributeError, *_DAMAGED) as error:
            raise AssemblyError(f"{path} is not a history of a fit, or is damaged.") from error


_DAMAGED = (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError)
"""What `zipfile` raises for damaged, encrypted and unknown members."""


def _key(number: int, step: str) -> str:
    return f"round_{number:03d}_{step}"


def _read(path: str | Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The header and all arrays of a file.

    Raises:
        AssemblyError, OSError, ValueError, KeyError, TypeError, EOFError, _DAMAGED: if it is none of ours.
    """
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        if sum(entry.file_size for entry in entries) > MAX_BYTES:
            raise AssemblyError(f"{path} is not a history: it unpacks to more than {MAX_BYTES >> 20} MiB.")
        if any(entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for entry in entries):
            raise ValueError("a member is compressed in another way")
        contents = {entry.filename.removesuffix(".npy"): archive.read(entry) for entry in entries}
    header = parse_plain(_array(contents.pop("header")).tobytes())
    if header["format"] != FORMAT:
        raise ValueError(f"the format is {shown(header['format'])}")
    if header["version"] != VERSION:
        raise AssemblyError(
            f"{path} has version {shown(header['version'])}; this release reads version {VERSION}."
        )
    return header, {name: _array(content) for name, content in contents.items()}


def _array(content: bytes) -> np.ndarray:
    """The array of an .npy file, of which as much must be there as its header claims before any is allocated.

    Raises:
        ValueError: if it holds something else.
    """
    from numpy.lib import format as npy

    stream = BytesIO(content)
    if npy.read_magic(stream) != (1, 0):
        raise ValueError("the array is of another version")
    shape, fortran, dtype = npy.read_array_header_1_0(stream)
    if dtype.hasobject or fortran or min(shape, default=0) < 0:
        raise ValueError("the array is of another kind")
    if math.prod(shape) * dtype.itemsize != len(content) - stream.tell():
        raise ValueError("the array is not as long as its header says")
    return np.frombuffer(content, dtype, offset=stream.tell()).reshape(shape)


def _from_header(header: dict[str, Any], arrays: dict[str, np.ndarray]) -> History:
    """The history of a file's header and arrays.

    Raises:
        ValueError, KeyError, TypeError, AttributeError: if something in them is not as `History.save` writes it.
    """
    if header["family"] not in FAMILIES:
        raise ValueError(f"the family is {shown(header['family'])}")
    rounds = []
    for number, entry in enumerate(header["rounds"]):
        rows = {step: arrays[_key(number, step)] for step in STEPS}
        for array in rows.values():
            if array.dtype != np.float32 or array.ndim != 2 or array.shape[1] != ROW:
                raise ValueError(f"rows have shape {array.shape}")
            if not np.isfinite(array).all():
                raise ValueError("a row has a number that is not finite")
        if len(rows["refined"]) != len(rows["chosen"]):
            raise ValueError("refinement keeps the number of parts")
        if not all(is_number(value) for value in entry["score"].values()):
            raise ValueError("a score is not a number")
        rounds.append(
            HistoryRound(
                regions=tuple(_checked_region(region) for region in entry["regions"]),
                score=dict(entry["score"]),
                accepted=bool(entry["accepted"]),
                **rows,
            )
        )
    place = header["transform"]
    if (
        not all(is_number(value) for value in (place["scale"], *place["translation"]))
        or not place["scale"] > 0
    ):
        raise ValueError("the transform is none")
    transform = Transform(place["scale"], tuple(place["translation"]))
    return History(header["family"], transform, tuple(rounds))


def _checked_region(region: Any) -> dict[str, Any]:
    """A region, if it is an object whose box, where it has one, is one.

    Raises:
        ValueError, TypeError, AttributeError: if not.
    """
    if not {"lower", "upper", "resolution"} <= set(region):
        return dict(region)
    box = [region["lower"], region["upper"], region["resolution"]]
    if not all(len(corner) == 3 and all(is_number(value) for value in corner) for corner in box[:2]):
        raise ValueError("a corner of a region's box is not three numbers")
    if not is_number(box[2]) or not box[2] > 0 or max(map(abs, (*box[0], *box[1]))) > MAX_CELLS * box[2]:
        raise ValueError("a region's box is not near the grid")
    return dict(region)


def score_values(score: Any) -> dict[str, float]:
    """The fields of a score (a dataclass of numbers) as JSON values."""
    return {field.name: getattr(score, field.name) for field in fields(score)}
