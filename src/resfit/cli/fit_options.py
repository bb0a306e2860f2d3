"""The options of a fit on the command line, made from their table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, TypedDict

from cyclopts import Group, Parameter

from resfit.fitter.config import PUBLIC, TYPES

MORE = Group("More options", show=False)
"""Shown by --help-all only."""


def parameter(name: str) -> Parameter:
    """Parameter of cyclopts for an option: what it is to know beside the type."""
    entry = PUBLIC[name]
    told = Parameter(help=entry.help, negative=list(entry.flags)[1:] or "")
    return Parameter.combine(told, Parameter(group=MORE)) if entry.rare else told


def values(given: Mapping[str, Any] | None) -> dict[str, Any]:
    """Values of options from what cyclopts makes of a command line: flags are the values that they stand for."""
    found = dict(given or {})
    for name, value in found.items():
        if flags := PUBLIC[name].flags:
            found[name] = list(flags.values())[0 if value else 1]
    return found


if TYPE_CHECKING:
    FitArguments = dict[str, Any]
else:
    FitArguments = TypedDict(
        "FitArguments",
        {
            name: Annotated[bool if entry.flags else TYPES[name], parameter(name)]
            for name, entry in PUBLIC.items()
        },
        total=False,
    )
    """All of them, as one parameter of a command: those that are not given are left out."""
