"""Decoding of EXT_meshopt_compression, as appendices A and B of that extension's specification define it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from .gltf_record import Record

Bytes = npt.NDArray[np.uint8]

TAIL = 32
"""Least length of what ends an attribute stream; its last bytes are the element before the first."""
SHARE = {"ATTRIBUTES": 64, "TRIANGLES": 12, "INDICES": 4}
"""Bytes that one compressed byte can stand for at most."""
PAIRS = [bytes((byte >> shift) & 3 for shift in (6, 4, 2, 0)) for byte in range(256)]
NIBBLES = [bytes((byte >> 4, byte & 15)) for byte in range(256)]


def decode_view(record: Record, data: memoryview) -> bytes:
    """The bytes of a bufferView that is compressed.

    Args:
        record: the extension's object.
        data: the compressed bytes that it points at.

    Raises:
        InputError: if the data is damaged, or a field of the record has no valid value.
    """
    mode, count, stride = (
        record.text("mode"),
        record.integer("count"),
        record.integer("byteStride", low=1, high=256),
    )
    if mode not in SHARE:
        raise record.invalid("mode", f"one of {', '.join(SHARE)}")
    if stride % 4 if mode == "ATTRIBUTES" else stride not in (2, 4):
        raise record.invalid("byteStride", "a multiple of 4" if mode == "ATTRIBUTES" else "2 or 4")
    kind = record.text("filter", "NONE")
    if kind not in FILTERS or stride % FILTERS[kind][0]:
        raise record.invalid("filter", "a filter for this byteStride")
    try:
        if count * stride > SHARE[mode] * len(data):
            raise ValueError
        if mode == "ATTRIBUTES":
            return FILTERS[kind][1](_attributes(bytes(data), count, stride)).tobytes()
        decode = _triangles if mode == "TRIANGLES" else _indices
        return np.array(decode(bytes(data), count), np.int64).astype(f"<u{stride}").tobytes()
    except (ValueError, IndexError):
        raise InputError(
            f"the meshopt data of '{record.path}' at {record.where} cannot be decoded; export it again, or without"
            " that compression."
        ) from None


def _attributes(data: bytes, count: int, stride: int) -> Bytes:
    """Elements (count, stride) of a stream of blocks, in which each byte of the elements has its own channel."""
    _check_header(data, 0xA0)
    end = len(data) - max(TAIL, stride)
    most = min((8192 // stride) & ~15, 256)
    before = np.frombuffer(data, np.uint8, stride, len(data) - stride)
    blocks, position = [np.zeros((0, stride), np.uint8)], 1
    for first in range(0, count, most):
        size = min(most, count - first)
        deltas = bytearray()
        for _ in range(stride):
            channel, position = _channel(data, position, -(-size // 16))
            deltas += channel
        if position > end:
            raise ValueError
        zigzag = np.frombuffer(deltas, np.uint8).reshape(stride, -1)[:, :size]
        steps = (zigzag >> 1) ^ (0 - (zigzag & 1))
        blocks.append((np.cumsum(steps, axis=1, dtype=np.uint8) + before[:, None]).T)
        before = blocks[-1][-1]
    return np.concatenate(blocks)


def _channel(data: bytes, position: int, groups: int) -> tuple[bytearray, int]:
    """Deltas of one byte of a block's elements, 16 for each group, and the position behind them."""
    heads, position = position, position + -(-groups // 4)
    found = bytearray()
    for group in range(groups):
        bits = (data[heads + group // 4] >> (group % 4 * 2)) & 3
        if bits == 0:
            found += bytes(16)
        elif bits == 3:
            found += data[position : position + 16]
            position += 16
        else:
            width, table, sentinel = (4, PAIRS, 3) if bits == 1 else (8, NIBBLES, 15)
            values = bytearray(b"".join([table[byte] for byte in data[position : position + width]]))
            position += width
            place = -1
            for _ in range(values.count(sentinel)):
                place = values.index(sentinel, place + 1)
                values[place] = data[position]
                position += 1
            found += values
    if len(found) != 16 * groups:
        raise ValueError
    return found, position


def _triangles(data: bytes, count: int) -> list[int]:
    """Corners of triangles, each told by an edge and a vertex that came shortly before where that is possible."""
    _check_header(data, 0xE1)
    if count % 3 or len(data) < 17 + count // 3:
        raise ValueError
    table = data[-16:]
    stream = _Stream(data[1 + count // 3 : -16])
    edges, vertices = [(0, 0)] * 16, [0] * 16
    edge, vertex, following, last = 0, 0, 0, 0
    found: list[int] = []

    def corner(code: int) -> int:
        """The corner that a half byte tells: a new one, one of the last, or one spelt out."""
        nonlocal vertex, following, last
        if 0 < code < 15:
            return vertices[(vertex - code) & 15]
        if code == 0:
            corner, following = following, following + 1
        else:
            corner = last = stream.index(last)
        return corner

    def push(corner: int) -> None:
        nonlocal vertex
        vertices[vertex & 15] = corner
        vertex += 1

    for code in data[1 : 1 + count // 3]:
        high, low = code >> 4, code & 15
        if high < 15:
            a, b = edges[(edge - 1 - high) & 15]
            if 0 < low < 13:
                c = vertices[(vertex - 1 - low) & 15]
            else:
                if low in (13, 14):
                    c = last = last + (1 if low == 14 else -1)
                else:
                    c = corner(low)
                push(c)
        else:
            codes = table[low] if low < 14 else stream.byte()
            if low >= 14 and codes == 0:
                following = 0
            a = corner(15 if low == 15 else 0)
            b, c = corner(codes >> 4), corner(codes & 15)
            push(a)
            for told, value in ((codes >> 4, b), (codes & 15, c)):
                if told in (0, 15):
                    push(value)
            edges[edge & 15] = b, a
            edge += 1
        edges[edge & 15], edges[(edge + 1) & 15] = (c, b), (a, c)
        edge += 2
        found += (a, b, c)
    stream.check_end()
    return found


def _indices(data: bytes, count: int) -> list[int]:
    """Indices told by steps from one of two that came before."""
    _check_header(data, 0xD1)
    stream, last, found = _Stream(data[1:-4]), [0, 0], []
    for _ in range(count):
        value = stream.integer()
        base = value & 1
        last[base] += -((value >> 2) + 1) if value & 2 else value >> 2
        last[base] &= 0xFFFFFFFF
        found.append(last[base])
    stream.check_end()
    return found


class _Stream:
    """Bytes that are read one after the other."""

    def __init__(self, data: bytes) -> None:
        self.data, self.position = data, 0

    def byte(self) -> int:
        self.position += 1
        return self.data[self.position - 1]

    def integer(self) -> int:
        """An unsigned LEB128 of 32 bits."""
        value = 0
        for shift in range(0, 35, 7):
            byte = self.byte()
            value |= (byte & 127) << shift
            if byte < 128:
                return value & 0xFFFFFFFF
        raise ValueError

    def index(self, last: int) -> int:
        """An index by its step from the last one."""
        value = self.integer()
        return (last + (-((value >> 1) + 1) if value & 1 else value >> 1)) & 0xFFFFFFFF

    def check_end(self) -> None:
        if self.position != len(self.data):
            raise ValueError


def _check_header(data: bytes, header: int) -> None:
    if not data or data[0] != header:
        raise ValueError


def _exponential(elements: Bytes) -> npt.NDArray[Any]:
    packed = np.ascontiguousarray(elements).view("<i4")
    return np.ldexp(((packed << 8) >> 8).astype(np.float32), packed >> 24).astype("<f4")


def _quaternion(elements: Bytes) -> npt.NDArray[Any]:
    packed = np.ascontiguousarray(elements).view("<i2")
    one = (packed[:, 3] | 3).astype(np.float64)
    three = packed[:, :3] / one[:, None] / np.sqrt(2.0)
    largest = np.sqrt(np.maximum(0.0, 1.0 - (three * three).sum(axis=1)))
    values = np.rint(np.column_stack([largest, three]) * 32767.0).astype("<i2")
    places = ((packed[:, 3:] & 3) + np.arange(4)) % 4
    found = np.empty_like(values)
    np.put_along_axis(found, places.astype(np.int64), values, axis=1)
    return found


def _unfiltered(elements: Bytes) -> Bytes:
    return elements


FILTERS = {
    "NONE": (1, _unfiltered),
    # Of normals and tangents, which nobody here reads.
    "OCTAHEDRAL": (4, _unfiltered),
    "QUATERNION": (8, _quaternion),
    "EXPONENTIAL": (4, _exponential),
}
"""Filter: what the byteStride has to be a multiple of, and its inverse."""
