"""The story of a fit, round by round: what was tried, chosen, refined and kept. history.npz in a fit's folder.

The fitter fills it, players show it. Only arrays and one JSON text are in the file: loading it runs no code.
"""

from __future__ import annotations

import json
import zipfile
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
from .primitive import shown
from .transform import Transform

FORMAT = "resfit-history"
VERSION = 1
STEPS = ("candidates", "chosen", "refined", "kept")
"""The row arrays of a round, in the order in which they come about."""

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
            raise AssemblyError(f"cannot read {path}: {error.strerror or error}") from error
        except (ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
            raise AssemblyError(f"{path} is not a history of a fit, or is damaged") from error


def _key(number: int, step: str) -> str:
    return f"round_{number:03d}_{step}"


def _read(path: str | Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The header and all arrays of a file.

    Raises:
        AssemblyError, OSError, ValueError, KeyError, zipfile.BadZipFile: if it is none of ours.
    """
    with zipfile.ZipFile(path) as archive:
        if sum(entry.file_size for entry in archive.infolist()) > MAX_BYTES:
            raise AssemblyError(f"{path} is not a history: it unpacks to more than {MAX_BYTES >> 20} MiB")
    with np.load(path, allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    header = json.loads(arrays.pop("header").tobytes())
    if header["format"] != FORMAT:
        raise ValueError(f"the format is {shown(header['format'])}")
    if header["version"] != VERSION:
        raise AssemblyError(
            f"{path} has version {shown(header['version'])}; this release reads version {VERSION}"
        )
    return header, arrays


def _from_header(header: dict[str, Any], arrays: dict[str, np.ndarray]) -> History:
    if header["family"] not in FAMILIES:
        raise ValueError(f"the family is {shown(header['family'])}")
    rounds = []
    for number, entry in enumerate(header["rounds"]):
        rows = {step: arrays[_key(number, step)] for step in STEPS}
        for array in rows.values():
            if array.dtype != np.float32 or array.ndim != 2 or array.shape[1] != ROW:
                raise ValueError(f"rows have shape {array.shape}")
        rounds.append(
            HistoryRound(
                regions=tuple(entry["regions"]),
                score=dict(entry["score"]),
                accepted=bool(entry["accepted"]),
                **rows,
            )
        )
    transform = Transform(header["transform"]["scale"], tuple(header["transform"]["translation"]))
    return History(header["family"], transform, tuple(rounds))


def score_values(score: Any) -> dict[str, float]:
    """The fields of a score (a dataclass of numbers) as JSON values."""
    return {field.name: getattr(score, field.name) for field in fields(score)}
