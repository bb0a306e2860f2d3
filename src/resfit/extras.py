"""Requirements of resfit, and the optional packages as pyproject.toml groups them. Imports nothing heavy."""

from __future__ import annotations

import re
import shlex
from contextlib import suppress
from importlib.metadata import requires
from pathlib import Path

from resfit.children import python_command


def requirements(extra: str = "") -> dict[str, str]:
    """Package to requirement, such as `DracoPy>=2`, of an extra; of what is always required unless one is given."""
    found = {}
    for line in requires("resfit") or []:
        wanted, _, marker = (part.strip() for part in line.partition(";"))
        group = re.search(r"""extra == ['"]([\w-]+)""", marker)
        name = re.match(r"[\w.-]+", wanted)
        if name and (group[1] if group else "") == extra:
            found[name[0]] = wanted
    return found


def run_command(*arguments: str) -> str:
    """A shell command that runs the Python of this process with arguments such as `-m pip`."""
    python = Path(python_command()[0])
    # The current folder may be gone, or the interpreter be elsewhere.
    with suppress(OSError, ValueError):
        python = python.relative_to(Path.cwd())
    return shlex.join([str(python), *arguments])


def command_for(extra: str) -> str:
    """A shell command that gets the packages of an extra by their own names: it works wherever resfit came from."""
    return run_command("-m", "pip", "install", *requirements(extra).values())
