"""The records of a PLY file, found in its bytes."""

from __future__ import annotations

import struct
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from .ply_header import Element, Property
from .text import printable

CODES = {
    "i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q",
    "f4": "f", "f8": "d",
}  # fmt: skip
"""NumPy's codes of types: those of `struct`."""

Placed = tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], int]
"""Starts, lengths of lists and end, as in `Records`."""


@dataclass(frozen=True)
class Records:
    """Byte offsets of the records of an element."""

    element: Element
    data: bytes | memoryview
    starts: npt.NDArray[np.int64]
    """(n,) byte at which each record begins; as many as the data hold, at most those that the header says."""
    lengths: npt.NDArray[np.int64]
    """(n, k) number of values in each of its k lists."""
    end: int
    """The byte behind the last record."""

    def values(self, entry: Property) -> npt.NDArray[np.float64]:
        """A property with one value (n,)."""
        with np.errstate(invalid="ignore"):  # Some NaN of damaged files are told at every conversion.
            return self._gather(self.begin(entry), entry.item, 1).reshape(-1).astype(np.float64)

    def lists(self, entry: Property) -> tuple[npt.NDArray, npt.NDArray[np.int64]]:
        """The values of a list, record after record, and how many each record has, (n,)."""
        assert entry.length is not None
        begin = self.begin(entry) + entry.length.itemsize
        which = [other for other in self.element.properties if other.length is not None].index(entry)
        lengths = self.lengths[:, which]
        first = np.cumsum(lengths) - lengths
        found = np.zeros(int(lengths.sum()), entry.item.newbyteorder("="))
        for length in np.unique(lengths[lengths > 0]):
            rows = np.flatnonzero(lengths == length)
            part = self._gather(begin[rows], entry.item, int(length))
            if len(rows) == len(lengths):
                return part.reshape(-1), lengths
            found[first[rows][:, None] + np.arange(length)] = part
        return found, lengths

    def begin(self, entry: Property) -> npt.NDArray[np.int64]:
        """(n,) byte at which a property begins."""
        begin, lists = self.starts.copy(), 0
        for other in self.element.properties:
            if other is entry:
                break
            if other.length is None:
                begin += other.item.itemsize
            else:
                begin += other.length.itemsize + self.lengths[:, lists] * other.item.itemsize
                lists += 1
        return begin

    def _gather(self, begin: npt.NDArray[np.int64], dtype: np.dtype, width: int) -> npt.NDArray:
        """(n, width) values that lie at any bytes, in the machine's byte order."""
        if not len(begin):
            return np.zeros((0, width), dtype.newbyteorder("="))
        size = dtype.itemsize * width
        windows = np.ndarray((len(self.data) - size + 1,), np.dtype((np.void, size)), self.data, strides=(1,))
        return windows[begin].view(dtype).reshape(-1, width).astype(dtype.newbyteorder("="), copy=False)


def place_records(data: bytes | memoryview, begin: int, element: Element, where: str) -> Records:
    """The records of an element, from a byte of the data on.

    Nothing is set aside for records that the data do not hold, whatever the header says.

    Raises:
        InputError: if a list has a length that is none.
    """
    single = sum(entry.item.itemsize for entry in element.properties if entry.length is None)
    lists = [entry for entry in element.properties if entry.length is not None]
    least = single + sum(entry.length.itemsize for entry in lists if entry.length is not None)
    if not least:
        return Records(element, data, np.zeros(0, np.int64), np.zeros((0, len(lists)), np.int64), begin)
    count = min(element.count, (len(data) - begin) // least)
    if not lists:
        starts = begin + least * np.arange(count)
        return Records(element, data, starts, np.zeros((count, 0), np.int64), begin + least * count)
    starts, lengths, end = _equal_records(data, begin, element, count, where)
    if len(starts) < count:
        more, rest, end = _walk(data, end, element, count - len(starts), where)
        starts, lengths = np.concatenate([starts, more]), np.concatenate([lengths, rest])
    return Records(element, data, starts, lengths, end)


def _equal_records(data: bytes | memoryview, begin: int, element: Element, count: int, where: str) -> Placed:
    """The first records, as far as their lists are as long as those of the very first."""
    starts, lengths, end = _walk(data, begin, element, min(count, 1), where)
    if not len(starts):
        return starts, lengths, end
    size = end - begin
    count = min(count, (len(data) - begin) // size)
    first = Records(element, data, starts, lengths, end)
    equal = count
    for number, entry in enumerate(entry for entry in element.properties if entry.length is not None):
        column = np.ndarray((count,), entry.length, data, int(first.begin(entry)[0]), (size,))
        other = np.flatnonzero(column != lengths[0, number])
        equal = min(equal, int(other[0]) if len(other) else count)
    return begin + size * np.arange(equal), np.repeat(lengths, equal, axis=0), begin + size * equal


def _walk(data: bytes | memoryview, begin: int, element: Element, count: int, where: str) -> Placed:
    """Records one after the other: where one begins depends on the lists of all before it."""
    steps, before = [], 0
    for entry in element.properties:
        if entry.length is None:
            before += entry.item.itemsize
        else:
            steps.append((before, _unpacker(entry.length), entry.length.itemsize, entry.item.itemsize))
            before = 0
    starts, lengths = array("q"), array("q")
    position, end = begin, len(data)
    for _ in range(count):
        at = position
        for skip, unpack, width, size in steps:
            at += skip
            if at + width > end:
                break
            length = unpack(data, at)[0]
            if not length >= 0 or length % 1:
                raise InputError(
                    f"a list of '{printable(element.name)}' in {where} has {length:g} values; the file is damaged,"
                    " export it again."
                )
            at += width + int(length) * size
            if at > end:
                break
            lengths.append(int(length))
        at += before
        if at > end or len(lengths) < (len(starts) + 1) * len(steps):
            break
        starts.append(position)
        position = at
    found = np.array(lengths, np.int64)[: len(starts) * len(steps)]
    return np.array(starts, np.int64), found.reshape(-1, len(steps)), position


def _unpacker(dtype: np.dtype) -> Callable[[bytes | memoryview, int], tuple[Any, ...]]:
    """Function that reads one number of a type at any byte."""
    order, code = dtype.str[0], dtype.str[1:]
    return struct.Struct(order.replace("|", "<") + CODES[code]).unpack_from
