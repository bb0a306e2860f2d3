"""An exporter: the suffixes of a format, and the function that writes it."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypedDict

if TYPE_CHECKING:
    from .overlay import Surface


class ExportOptions(TypedDict, total=False):
    """Options of exports; each format takes some, and None leaves one as the format has it."""

    merged: bool | None
    """One surface of the smooth union, or one closed surface a part."""
    resolution: int | None
    """Cells along the longest side, of the whole or of each part."""
    device: str | None
    """Where the field is evaluated: `auto` (the CPU), `cpu`, `cuda:0`."""
    mesh: Surface | None
    """The input, in its own frame, to be shown over the assembly."""
    up: Literal["y", "z"] | None
    """The axis that points up at first."""
    title: str | None
    """Shown above the list of parts."""
    facts: Sequence[str] | None
    """Sentences about where the assembly came from."""


@dataclass(frozen=True)
class Exporter:
    """A format that assemblies are written in."""

    suffixes: tuple[str, ...]
    """Lower case, with the dot."""
    write: Callable[..., None]
    """Writes an assembly to a path, at once or not at all; its keywords are the options that the format takes."""

    @property
    def options(self) -> tuple[str, ...]:
        """Names of the options that it takes, of `ExportOptions`."""
        parameters = inspect.signature(self.write).parameters.values()
        return tuple(entry.name for entry in parameters if entry.kind is entry.KEYWORD_ONLY)
