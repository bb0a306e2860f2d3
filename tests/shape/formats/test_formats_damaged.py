"""Damaged text meshes and PLY files: each is read, or ends in one sentence that names it."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest

from resfit.errors import InputError
from resfit.shape.formats import obj, off, ply
from resfit.shape.formats.mesh_file import MeshFile

FIELD_INPUTS = Path(__file__).parents[2] / "data" / "field_inputs"
READERS: dict[str, Callable[[Path], MeshFile]] = {"obj": obj.read, "off": off.read, "ply": ply.read}
EXTRA = {
    "obj": [
        b"v 0 0 0 1\nv 1 0 0\nvt 0 0\nv 1 1 0\nv 0 1 0\n# c\nf 1/1/1 2//1 3/1 \\\n 4\nl 1 2 3\np 1 2\ng a b\n"
        b"f -1 -2 -3\nsurf 0 1 0 1\ncall x.obj\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".encode("utf-16"),
    ],
    "off": [
        b"4OFF 4 2 0\n0 0 0 1\n1 0 0 1 # x\n0 1 0 2\n0 0 1 1\n\n3 0 1 2 255 0 0\n4 0 1 2 3\n",
        b"nOFF\n3\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 0.5 0.5 0.5\n2 0 1\n",
    ],
    "ply": [],
}
BITS = [
    b"nan", b"inf", b"-1", b"0", b"99999999999999999999", b"1e400", b"-9223372036854775808", b"1,5", b"\\\n", b"#",
    b"/", b"//", b"\r", b"\n", b"\t", b"\v", b"\0", b"\xff\xfe", b"ply\n", b"OFF", b"f ", b"v ", b"o ", b"g \xe4",
    b"element face 1000000000000\n", b"list ", b"-2", b"4294967295", b"1.5", b"property list float float z\n",
    b"element x 9\n", b"end_header\n", b"surf 1\n", b"BINARY", b"binary_big_endian",
]  # fmt: skip


def damage(chance: random.Random, data: bytes) -> bytes:
    """A few bytes cut, changed, put in, taken away, said twice or swapped by lines."""
    for _ in range(chance.randint(1, 4)):
        at = chance.randrange(len(data) + 1)
        end = at + chance.randint(1, 12)
        kind = chance.randrange(7)
        if kind == 0:
            data = data[:at]
        elif kind == 1:
            data = (
                data[:at]
                + bytes(byte ^ 1 << chance.randrange(8) for byte in data[at : at + 1])
                + data[at + 1 :]
            )
        elif kind == 2:
            data = data[:at] + chance.choice(BITS) + data[chance.choice((at, end)) :]
        elif kind == 3:
            data = data[:at] + data[end:]
        elif kind == 4:
            data = data[:at] + chance.randbytes(chance.randint(1, 8)) + data[at:]
        elif kind == 5:
            data = data[:end] + data[at:]
        else:
            lines = data.split(b"\n")
            one, other = chance.randrange(len(lines)), chance.randrange(len(lines))
            lines[one], lines[other] = lines[other], lines[one]
            data = b"\n".join(lines)
    return data


def check_damaged(folder: Path, suffix: str, seed: int, count: int) -> None:
    """Read files damaged at random; those that are read hold only what their faces may name."""
    chance = random.Random(seed)
    originals = [path.read_bytes() for path in sorted(FIELD_INPUTS.glob(f"*.{suffix}"))] + EXTRA[suffix]
    path = folder / f"damaged.{suffix}"
    for _ in range(count):
        path.write_bytes(damage(chance, chance.choice(originals)))
        try:
            file = READERS[suffix](path)
        except InputError as error:
            assert str(path) in str(error) and str(error).endswith(".") and "\n" not in str(error)
            continue
        for piece in file.pieces:
            assert piece.vertices.shape[1:] == piece.faces.shape[1:] == (3,)
            assert not len(piece.faces) or 0 <= piece.faces.min() <= piece.faces.max() < len(piece.vertices)


@pytest.mark.parametrize("suffix", READERS)
def test_damaged_files_are_read_or_refused(tmp_path: Path, suffix: str) -> None:
    check_damaged(tmp_path, suffix, seed=0, count=300)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", READERS)
def test_many_damaged_files_are_read_or_refused(tmp_path: Path, suffix: str) -> None:
    check_damaged(tmp_path, suffix, seed=1, count=4000)
