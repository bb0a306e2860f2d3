"""Primitive families from outside the package: of installed packages, and from files that the user names.

A package registers a family by an entry point of the group `resfit.families` that leads to a `Family`. A single file
defines `FAMILY` and is named by the environment variable RESFIT_FAMILIES, several by the separator of PATH. No other
file is ever executed.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

from resfit.errors import InputError

from .family import Family

GROUP = "resfit.families"
VARIABLE = "RESFIT_FAMILIES"


def outside_families() -> list[Family]:
    """The families of installed packages and of named files, in alphabetical order.

    Raises:
        InputError: if a file or an entry point cannot be used.
    """
    found = [_of_entry_point(entry) for entry in entry_points(group=GROUP)]
    found += [_of_file(Path(name)) for name in os.environ.get(VARIABLE, "").split(os.pathsep) if name]
    return sorted(found, key=lambda entry: entry.name)


def _of_entry_point(entry: EntryPoint) -> Family:
    try:
        loaded = entry.load()
    except (Exception, SystemExit) as error:
        raise InputError(
            f"the primitive family '{entry.name}' cannot be imported from {entry.value}."
        ) from error
    return _checked(loaded, f"the entry point '{entry.name}'")


def _of_file(path: Path) -> Family:
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "is not there"
        raise InputError(f"{path}, which {VARIABLE} names, {what}; name a Python file that defines FAMILY.")
    # Warp reads the kernels' text from the file, and finds their names in the module.
    name = f"resfit_family_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path.resolve())
    if spec is None or spec.loader is None:
        raise InputError(f"{path}, which {VARIABLE} names, is no Python file.")
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        # A file that ends the interpreter would end ours, with its exit code.
        told = error if isinstance(error, Exception) else "it ends the interpreter"
        raise InputError(f"{path}, which {VARIABLE} names, does not run: {told}.") from error
    return _checked(getattr(module, "FAMILY", None), str(path))


def _checked(found: object, origin: str) -> Family:
    if not isinstance(found, Family):
        raise InputError(f"{origin} holds no primitive family; it must define FAMILY.")
    return found
