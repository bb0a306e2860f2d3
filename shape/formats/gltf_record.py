"""JSON objects of a glTF file: whatever is taken out of one is checked first."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path
from typing import Any

from resfit.errors import InputError

LARGEST = 1e300
"""Numbers beyond are refused: their squares are infinite."""


class Record:
    """One object of the file's JSON. Every method raises InputError for a value of the wrong kind.

    Absent keys give the default where there is one, else the same error.
    """

    __slots__ = ("path", "value", "where")

    def __init__(self, path: Path, where: str, value: Any) -> None:
        """Take an object.

        Args:
            path: of the file, for messages.
            where: where it stands in the file, as `nodes[3]`; empty at the top.
            value: what json.loads made of it.
        """
        if not isinstance(value, dict):
            raise invalid(path, where or "the JSON", value, "an object")
        self.path, self.where, self.value = path, where, value

    def invalid(self, key: str, wanted: str) -> InputError:
        """The error that says what `key` is, and what belongs there."""
        return invalid(self.path, self._name(key), self.value.get(key), wanted)

    def integer(self, key: str, default: int | None = None, low: int = 0, high: int | None = None) -> int:
        """An integer in low..high; `default` where the key is absent."""
        value = self.value.get(key, default)
        # Some exporters write 3.0.
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if (
            isinstance(value, bool)
            or not isinstance(value, int)
            or value < low
            or (high is not None and value > high)
        ):
            limits = f"an integer from {low}" + ("" if high is None else f" to {high}")
            raise self.invalid(key, "nothing" if high is not None and high < low else limits)
        return value

    def index(self, key: str, items: Collection[Any]) -> int | None:
        """An index into `items`; None where the key is absent."""
        return self.integer(key, high=len(items) - 1) if key in self.value else None

    def indices(self, key: str, items: Collection[Any]) -> list[int]:
        """A list of indices into `items`; empty where the key is absent."""
        found = self._list(key)
        for value in found:
            if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < len(items):
                raise self.invalid(key, f"a list of integers from 0 to {len(items) - 1}")
        return found

    def numbers(self, key: str, count: int) -> list[float] | None:
        """A list of finite numbers of that length; None where the key is absent."""
        if key not in self.value:
            return None
        found = self.value[key]
        if (
            not isinstance(found, list)
            or len(found) != count
            or not all(type(value) in (int, float) and -LARGEST < value < LARGEST for value in found)
        ):
            raise self.invalid(key, f"a list of {count} finite numbers")
        return [float(value) for value in found]

    def text(self, key: str, default: str = "") -> str:
        """A string; `default` where the key is absent."""
        value = self.value.get(key, default)
        if not isinstance(value, str):
            raise self.invalid(key, "a string")
        return value

    def name(self) -> str:
        """Its `name`, fit to be printed; empty where it has none."""
        value = self.value.get("name")
        return printable(value) if isinstance(value, str) else ""

    def texts(self, key: str) -> list[str]:
        """A list of strings; empty where the key is absent."""
        found = self._list(key)
        if not all(isinstance(value, str) for value in found):
            raise self.invalid(key, "a list of strings")
        return found

    def record(self, key: str) -> Record:
        """An object; an empty one where the key is absent."""
        return Record(self.path, self._name(key), self.value.get(key, {}))

    def records(self, key: str) -> list[Record]:
        """A list of objects; empty where the key is absent."""
        where = self._name(key)
        return [
            Record(self.path, f"{where}[{number}]", value) for number, value in enumerate(self._list(key))
        ]

    def extension(self, name: str) -> Record | None:
        """One of its extensions, or None."""
        found = self.record("extensions") if "extensions" in self.value else None
        return found.record(name) if found is not None and name in found.value else None

    def _list(self, key: str) -> list[Any]:
        found = self.value.get(key, [])
        if not isinstance(found, list):
            raise self.invalid(key, "a list")
        return found

    def _name(self, key: str) -> str:
        return f"{self.where}.{key}" if self.where else key


def invalid(path: Path, where: str, value: Any, wanted: str) -> InputError:
    """The error about a value of the file that is not what belongs there; None counts as missing."""
    if value is None:
        said = "is missing"
    elif isinstance(value, dict | list):
        said = "is an object" if isinstance(value, dict) else f"is a list of {len(value)}"
    else:
        shown = json.dumps(value)
        said = f"is {shown if len(shown) <= 40 else shown[:40] + '…'}"
    return InputError(f"'{path}' is no valid glTF: {where} {said} where {wanted} belongs; export it again.")


def printable(text: str) -> str:
    """A text of the file without line ends, control characters and lone surrogates, at most 200 characters."""
    if len(text) <= 200 and text.isprintable():
        return text
    return "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in text[:200])
