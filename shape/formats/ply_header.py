"""The header of a PLY file: which elements it holds, and how their records are laid out."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from resfit.errors import InputError

from .text import decode_name

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
"""Scalar types by both sets of names: NumPy's codes."""

ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
"""Formats: NumPy's codes of their byte order."""


@dataclass(frozen=True)
class Property:
    """One value of a record, or a list of values with their number before them."""

    name: str
    item: np.dtype
    length: np.dtype | None
    """Type of a list's number of values; None for a single value."""


@dataclass
class Element:
    """A table of records, all with the same properties."""

    name: str
    count: int
    """Records that the header says there are."""
    properties: list[Property] = field(default_factory=list)

    def find(self, *names: str) -> Property | None:
        """The property with one of some names."""
        return next((entry for entry in self.properties if entry.name in names), None)


@dataclass
class Header:
    """Header of a PLY file, which stands before the records."""

    is_text: bool
    elements: dict[str, Element]
    size: int
    """Bytes of the header."""
    lines: int
    """Lines of the header."""


def read_header(data: bytes, where: str) -> Header:
    r"""The header of a PLY file; its lines end with `\n`, `\r\n` or `\r`, as the first one does.

    Types are those of the records' bytes, or doubles where the records are text, which is read into doubles.

    Args:
        data: the file's bytes.
        where: what messages call it.

    Raises:
        InputError: if it is damaged.
    """
    if not data[:5].split() == [b"ply"] and data[:4] not in (b"ply\n", b"ply\r"):
        raise InputError(f"{where} is no PLY file: it does not begin with 'ply'; check what it is.")
    end_of_line = b"\r\n" if data[3:5] == b"\r\n" else b"\r" if data[3:4] == b"\r" else b"\n"
    order, elements, position, number = "", {}, 0, 0
    while True:
        end = data.find(end_of_line, position)
        end = end if end >= 0 else len(data)
        line = decode_name(data[position:end])
        words = line.split()
        number += 1
        if words == ["end_header"]:
            break
        if end == len(data):
            raise InputError(f"{where} ends in its header; export or download it again.")
        position = end + len(end_of_line)
        if number == 1 or not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) > 1 and words[1] in ORDERS:
            order = ORDERS[words[1]]
        elif not _take_line(words, order, elements):
            raise InputError(f"line {number} of {where} is no line of a PLY header; export the file again.")
    return Header(order == "=", elements, min(end + len(end_of_line), len(data)), number)


def _take_line(words: list[str], order: str, elements: dict[str, Element]) -> bool:
    """Add an element or a property; whether the line is one."""
    if words[0] == "element" and len(words) == 3 and words[1] not in elements:
        if not re.fullmatch(r"[0-9]{1,18}", words[2]):
            return False
        elements[words[1]] = Element(words[1], int(words[2]))
        return True
    kinds = words[2:4] if words[1:2] == ["list"] else words[1:2]
    if words[0] != "property" or not elements or not order or len(words) < 3:
        return False
    if len(words) != (5 if words[1] == "list" else 3) or not all(kind in TYPES for kind in kinds):
        return False
    types = [np.dtype("f8" if order == "=" else order + TYPES[kind]) for kind in kinds]
    element = next(reversed(elements.values()))
    element.properties.append(Property(words[-1], types[-1], types[0] if len(types) > 1 else None))
    return True
