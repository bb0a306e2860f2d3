"""The registry of primitive families: one file a family, found by scanning this folder.

A module that defines `FAMILY` is a family; `GRADIENT` in `<family>_gradient.py` beside it, where there is one, names
its hand-written adjoint.
"""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import replace

from resfit.errors import AssemblyError

from .family import Family, Parameter

__all__ = ["FAMILIES", "Family", "Parameter", "family"]


def _scan() -> dict[str, Family]:
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    modules = {name: importlib.import_module(f"{__name__}.{name}") for name in names}
    families: dict[str, Family] = {}
    for name, module in modules.items():
        if hasattr(module, "FAMILY"):
            gradient = modules.get(f"{name}_gradient")
            adjoint = gradient.GRADIENT if gradient else {}
            families[module.FAMILY.name] = replace(module.FAMILY, index=len(families), **adjoint)
    return families


FAMILIES: dict[str, Family] = _scan()
"""Every family by name, in alphabetical order."""


def family(name: str) -> Family:
    """The family called `name`.

    Raises:
        AssemblyError: if there is none.
    """
    if name not in FAMILIES:
        raise AssemblyError(f"no primitive family is called '{name}'; there are {', '.join(FAMILIES)}.")
    return FAMILIES[name]
