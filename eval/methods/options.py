"""Common base of methods: options that come as text, the folder of a result, packages that may be missing."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from resfit.errors import InputError
from resfit.extras import command_for


def read_options(options: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Options with values of the types of their defaults.

    Args:
        options: by name; values may be text, as the command line gives them.
        defaults: every option that there is.

    Raises:
        InputError: for a name that is not among the defaults, or a value of another type.
    """
    chosen = dict(defaults)
    for name, value in options.items():
        if name not in defaults:
            known = ", ".join(defaults) or "none"
            raise InputError(f"the method has no option {name}; there are: {known}.")
        kind = type(defaults[name])
        try:
            chosen[name] = kind(value)
        except (TypeError, ValueError):
            raise InputError(f"option {name} is {value!r}; it must be {_article(kind)}.") from None
    return chosen


def _article(kind: type) -> str:
    return {int: "a whole number", float: "a number"}.get(kind, "text")


def output_folder(out: Path) -> Path:
    """The folder `out`, made if it is not there.

    Raises:
        InputError: if it cannot be made.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot write to {out}: {error.strerror or error}.") from error
    return out


def optional_package(name: str) -> ModuleType:
    """A package of the extra `compare`.

    Raises:
        InputError: if it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise InputError(
            f"the package {name} is not installed; call {command_for('compare')} to get it."
        ) from error
