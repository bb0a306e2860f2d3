"""A line of text while it is typed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from resfit.errors import InputError

from ...assembly.primitive import MAX_NAME, shown


@dataclass(frozen=True)
class Entry:
    """Text entry in progress, and its field."""

    id: str
    """A slider's, or `name`."""
    label: str
    text: str
    fresh: bool = True
    """Whether nothing was typed yet: the first letter replaces what is there."""

    def typed(self, key: str) -> Entry:
        """The same after a key: a letter, or `BackSpace`; others change nothing."""
        if key == "BackSpace":
            return replace(self, text="" if self.fresh else self.text[:-1], fresh=False)
        if len(key) != 1 or not key.isprintable():
            return self
        return replace(self, text=(key if self.fresh else self.text + key)[:MAX_NAME], fresh=False)

    def number(self) -> float:
        """The text as a number.

        Raises:
            InputError: if it is none.
        """
        try:
            value = float(self.text.replace(",", "."))
        except ValueError:
            raise InputError(f"{shown(self.text)} is no number.") from None
        if not math.isfinite(value):
            raise InputError(f"{self.label} must be a finite number.")
        return value
