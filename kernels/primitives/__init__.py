"""The registry of primitive families: one file a family, found by scanning this folder, or registered from outside.

A module that defines `FAMILY` is a family. Others come from installed packages, by the entry points of the group
`resfit.families`, and from the files that the environment variable RESFIT_FAMILIES names; `plugins.py` loads both.
"""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import replace

from resfit.errors import AssemblyError

from .family import Family, Symmetries
from .parameters import Parameter
from .plugins import outside_families

__all__ = ["DEFAULT_FAMILY", "FAMILIES", "Family", "Parameter", "Symmetries", "family", "register"]

DEFAULT_FAMILY = "superfrustum"
"""What is fitted unless another is asked for."""

FAMILIES: dict[str, Family] = {}
"""Every family by name: the package's own in alphabetical order, then the others as they were registered."""


def register(entry: Family) -> Family:
    """The family as it stands in the registry from now on, its index set; kernels are made as they are needed.

    Raises:
        AssemblyError: if there is another family of that name.
    """
    if entry.name in FAMILIES:
        raise AssemblyError(f"there is a primitive family called '{entry.name}' already.")
    FAMILIES[entry.name] = replace(entry, index=len(FAMILIES))
    return FAMILIES[entry.name]


def family(name: str) -> Family:
    """The family called `name`.

    Raises:
        AssemblyError: if there is none.
    """
    if name not in FAMILIES:
        raise AssemblyError(f"no primitive family is called '{name}'; there are {', '.join(FAMILIES)}.")
    return FAMILIES[name]


def _scan() -> None:
    for module in sorted(module.name for module in pkgutil.iter_modules(__path__)):
        found = importlib.import_module(f"{__name__}.{module}")
        if hasattr(found, "FAMILY"):
            register(found.FAMILY)

    for entry in outside_families():
        register(entry)


_scan()
