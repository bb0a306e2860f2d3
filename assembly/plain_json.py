"""JSON that others wrote: bounded in size and depth, its numbers finite, its texts Unicode."""

from __future__ import annotations

import json
import math
import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any

MAX_DEPTH = 32
"""Objects and lists within each other; a report has five."""

MAX_DIGITS = 300
"""Of whole numbers: all of them are floating-point numbers too then."""


def read_bytes(path: str | Path, most: int) -> bytes:
    """All bytes of a regular file.

    Args:
        path: of the file.
        most: bytes that it may have.

    Raises:
        OSError: if it cannot be read.
        ValueError: if it is no regular file, or has more bytes.
    """
    # A named pipe would wait for its writer.
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with open(descriptor, "rb") as stream:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise ValueError("this is no regular file")
        content = stream.read(most + 1)
    if len(content) > most:
        raise ValueError(f"there are more than {most} bytes")
    return content


def parse_plain(content: bytes) -> Any:
    """The value of a JSON text; halves of surrogate pairs in its strings become `?`.

    Raises:
        ValueError: if it is not JSON in UTF-8, is nested too deeply, or has a number that is not finite.
    """
    try:
        value = json.loads(
            content.decode("utf-8"), parse_int=_whole, parse_float=_finite, parse_constant=_finite
        )
    except RecursionError:
        raise ValueError("the JSON is nested too deeply") from None
    check_depth(value, MAX_DEPTH)
    return _plain(value)


class DepthError(ValueError):
    """JSON whose objects and lists lie in each other too deeply."""


def check_depth(value: Any, most: int) -> None:
    """Refuse a value of JSON in which more than `most` objects and lists lie within each other.

    Raises:
        DepthError: if so.
    """
    level = [value] if isinstance(value, dict | list) else []
    for _ in range(most):
        inner = (
            entry for holder in level for entry in (holder.values() if isinstance(holder, dict) else holder)
        )
        level = [entry for entry in inner if isinstance(entry, dict | list)]
    if level:
        raise DepthError("the JSON is nested too deeply")


def is_number(value: Any) -> bool:
    """True if a value of JSON is a number that is finite as a float."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def at(value: Any, *keys: str) -> Any:
    """Value at a path of keys; None if there is nothing."""
    for key in keys:
        value = value.get(key) if isinstance(value, Mapping) else None
    return value


def number_at(value: Any, *keys: str) -> float | None:
    """A finite number at a path of keys; None if there is none."""
    found = at(value, *keys)
    return found if is_number(found) else None


def text_at(value: Any, *keys: str) -> str:
    """A text at a path of keys; empty if there is none."""
    found = at(value, *keys)
    return found if isinstance(found, str) else ""


def _whole(text: str) -> int:
    if len(text) > MAX_DIGITS:
        raise ValueError("a number has too many digits")
    return int(text)


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"the number {text} is not finite")
    return value


def _plain(value: Any) -> Any:
    if isinstance(value, str):
        return value if value.isascii() else value.encode("utf-8", "replace").decode("utf-8")
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    if isinstance(value, dict):
        return {_plain(key): _plain(entry) for key, entry in value.items()}
    return value
