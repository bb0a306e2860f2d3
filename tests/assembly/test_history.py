"""history.npz that is damaged or was made to hurt: refused in one sentence, before much memory is taken."""

from __future__ import annotations

import io
import json
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from resfit.assembly.assembly import Assembly
from resfit.assembly.history import STEPS, History, HistoryRound
from resfit.assembly.transform import Transform
from resfit.errors import AssemblyError, InputError
from resfit.kernels.rows import ROW, SHAPES, empty_rows
from resfit.viewer.playback.playback import load_playback


def rows(count: int = 2) -> np.ndarray:
    made = empty_rows(count)
    made[:, SHAPES : SHAPES + 3] = 0.5
    return made


@pytest.fixture
def content(tmp_path: Path) -> bytes:
    """A history of one round with two regions."""
    region = {"source": "msd", "resolution": 16, "lower": [0, 1, 2], "upper": [8, 9, 10]}
    steps = {name: rows() for name in STEPS}
    entry = HistoryRound((region, {"source": "solid"}), **steps, score={"objective": 0.5}, accepted=True)
    History("cuboid", Transform(), (entry,)).save(tmp_path / "good.npz")
    return (tmp_path / "good.npz").read_bytes()


def refused(path: Path, data: bytes) -> None:
    """Loading and playing both refuse this file in one sentence that names it."""
    path.write_bytes(data)
    assembly = Assembly.from_rows(rows(1), ["cuboid"], ["#112233"])
    for load in (lambda: History.load(path), lambda: load_playback(path.parent, assembly)):
        with pytest.raises(InputError) as caught:
            load()
        assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def members(data: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def packed(contents: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for name, member in contents.items():
            archive.writestr(name, member)
    return buffer.getvalue()


def with_header(data: bytes, change: Callable[[dict[str, Any]], Any]) -> bytes:
    arrays = dict(np.load(io.BytesIO(data)))
    header = json.loads(arrays.pop("header").tobytes())
    change(header)
    buffer = io.BytesIO()
    np.savez(buffer, header=np.frombuffer(json.dumps(header).encode(), np.uint8), **arrays)
    return buffer.getvalue()


def with_rows(data: bytes, step: str, array: np.ndarray) -> bytes:
    arrays = dict(np.load(io.BytesIO(data))) | {f"round_000_{step}": array}
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def npy(header: str, body: bytes = b"") -> bytes:
    text = header.ljust(117) + "\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text.encode() + body


def test_the_good_one_loads(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "history.npz").write_bytes(content)
    assert History.load(tmp_path / "history.npz").rounds[0].regions[0]["upper"] == [8, 9, 10]
    assert len(load_playback(tmp_path, Assembly.from_rows(rows(1), ["cuboid"], ["#112233"]))) == 6


@pytest.mark.parametrize("place", ["header", "rounds", "directory"])
def test_every_flipped_bit_is_read_or_refused(place: str, content: bytes, tmp_path: Path) -> None:
    path, size = tmp_path / "history.npz", len(content)
    begin = {"header": 0, "rounds": size // 2, "directory": size - 320}[place]
    for offset in range(begin, begin + 320, 3):
        data = bytearray(content)
        data[offset] ^= 1 << offset % 8
        path.write_bytes(data)
        try:
            History.load(path)
        except AssemblyError as error:
            assert str(path) in str(error)


def test_claims_are_checked_before_memory_is_taken(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "history.npz"
    for shape in ("(1000000000000, 17)", "(-1, 17)", "()", "(2, 17)", "x"):
        member = npy(f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}")
        refused(path, packed(members(content) | {"round_000_kept.npy": member}))
    pickled = npy("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }", b"cos\nsystem\n(S'true'\ntR.")
    refused(path, packed(members(content) | {"header.npy": pickled}))
    refused(path, packed(members(content), zipfile.ZIP_LZMA))
    refused(path, packed(members(content) | {"header.npy": b""}))


@pytest.mark.parametrize(
    "array",
    [np.full((2, ROW), value, np.float32) for value in (np.nan, np.inf, 1e38, -1.0)]
    + [rows().astype(np.float64), np.zeros((2, 3), np.float32), np.array(["x"])],
)
def test_rows_that_are_none(array: np.ndarray, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "history.npz"
    path.write_bytes(with_rows(content, "kept", array))
    with pytest.raises(InputError):
        load_playback(tmp_path, Assembly.from_rows(rows(1), ["cuboid"], ["#112233"]))


@pytest.mark.parametrize(
    ("keys", "values"),
    [
        (("rounds", 0, "regions"), [{"a": 1}, [1], None, 7]),
        (
            ("rounds", 0, "regions", 0, "lower"),
            [None, [1], "abc", [1, 2, {}], [1, 2, 10**400], [1, 2, 1e300]],
        ),
        (("rounds", 0, "regions", 0, "resolution"), [0, -1, None, "16", True]),
        (("rounds", 0, "score", "objective"), [[[]], "", None, 10**400, float("nan")]),
        (("rounds", 0, "score"), [None, 1]),
        (("transform", "translation", 2), [10**400, "x", None]),
        (("transform", "scale"), [0, "x", {}]),
        (("family",), [[], {}, None, "sphere"]),
    ],
)
def test_headers_that_lie(keys: tuple, values: list, content: bytes, tmp_path: Path) -> None:
    for value in values:

        def change(header: dict[str, Any], value: Any = value) -> None:
            place: Any = header
            for key in keys[:-1]:
                place = place[key]
            place[keys[-1]] = value

        refused(tmp_path / "history.npz", with_header(content, change))
