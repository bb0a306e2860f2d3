"""Seeded damage to files and documents: what storage, networks, editors and attackers do to them."""

from __future__ import annotations

import json
import random
import struct
from collections.abc import Sequence
from typing import Any

HURTING = (
    b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\0\0\xc0\x7f", b"\0\0\x80\x7f", bytes(4), b"\0\0\0\x7f",
)  # fmt: skip
"""Numbers that are likely to hurt: the largest and smallest counts, NaN, infinity, 1.7e38."""

WORDS = (b"nan", b"inf", b"-1", b"1e39", b"999999999999", b"", b"x", b"0", b"1e-320")

VALUES = (
    None, True, -1, 0, 1, 1.5, 2**31, 2**64, 10**400, 1e308, float("inf"), float("nan"), "", "x", "</script>", "0" * 64,
    "a\nb", "../../../etc/passwd", [], {}, [0], [[]], ["x"], [None], {"a": 1}, [1e39] * 3,
)  # fmt: skip
"""What a value of a JSON document is replaced by."""


def damaged_bytes(rng: random.Random, content: bytes) -> tuple[str, bytes]:
    """(what was done, the file with it): cut, bits flipped, bytes put in, removed, moved or replaced."""
    if not content:
        return "none", content
    data = bytearray(content)
    how = rng.choice(["cut", "flip", "flip", "insert", "remove", "swap", "numbers", "word"])
    place = rng.randrange(len(data))
    if how == "cut":
        del data[place:]
    elif how == "flip":
        for _ in range(rng.choice([1, 1, 2, 8, 64])):
            # The beginning of a file, or the directory at its end, decides most.
            near = rng.choice([64, 400, -300, len(data)])
            at = (
                rng.randrange(min(len(data), near)) if near > 0 else -1 - rng.randrange(min(len(data), -near))
            )
            data[at] ^= 1 << rng.randrange(8)
    elif how == "insert":
        data[place:place] = rng.randbytes(rng.choice([1, 2, 4, 100]))
    elif how == "remove":
        del data[place : place + rng.choice([1, 2, 4, 100])]
    elif how == "swap":
        other, size = rng.randrange(len(data)), rng.choice([4, 32, 200])
        data[place : place + size], data[other : other + size] = (
            data[other : other + size],
            data[place : place + size],
        )
    elif how == "numbers":
        data[place : place + 4] = rng.choice(HURTING)
    else:
        words = bytes(data).split(b" ")
        words[rng.randrange(len(words))] = rng.choice(WORDS)
        data = bytearray(b" ".join(words))
    return how, bytes(data)


def places_in(document: Any, limit: int = 10**9) -> list[tuple[Any, ...]]:
    """Paths of all values of a JSON document, of long lists the first `limit`."""
    found: list[tuple[Any, ...]] = []

    def walk(value: Any, path: tuple[Any, ...]) -> None:
        for key in list(value) if isinstance(value, dict) else range(min(len(value), limit)):
            found.append((*path, key))
            if isinstance(value[key], dict | list):
                walk(value[key], (*path, key))

    walk(document, ())
    return found


def holder(document: Any, path: Sequence[Any]) -> Any:
    """The object or list that holds the value at a path."""
    for key in path[:-1]:
        document = document[key]
    return document


def replaced(document: Any, path: Sequence[Any], value: Any) -> Any:
    """A copy of a JSON document with another value at a path."""
    changed = json.loads(json.dumps(document))
    holder(changed, path)[path[-1]] = value
    return changed


def damaged_document(rng: random.Random, document: Any) -> Any:
    """A copy of a JSON document, one value of it lost or replaced."""
    changed = json.loads(json.dumps(document))
    path = rng.choice(places_in(changed))
    if rng.random() < 0.3:
        del holder(changed, path)[path[-1]]
    else:
        holder(changed, path)[path[-1]] = rng.choice(VALUES)
    return changed


def damaged_gltf(rng: random.Random, content: bytes, suffix: str) -> bytes:
    """A glTF file, one value of its document lost or replaced; the headers tell the truth."""
    if suffix == "gltf":
        return json.dumps(damaged_document(rng, json.loads(content))).encode()
    size = struct.unpack("<I", content[12:16])[0]
    text = json.dumps(damaged_document(rng, json.loads(content[20 : 20 + size]))).encode()
    text += b" " * (-len(text) % 4)
    rest = content[20 + size :]
    head = b"glTF" + struct.pack("<II", 2, 20 + len(text) + len(rest))
    return head + struct.pack("<I4s", len(text), b"JSON") + text + rest
