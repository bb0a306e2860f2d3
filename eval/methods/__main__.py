"""Run one method on one mesh: `python -m resfit.eval.methods NAME MESH OUT [key=value ...]`.

Writes the path of the result to stdout. Exit codes: 0 done, 2 unusable input, option or missing package (a sentence on
stderr); anything else is a defect or a crash of the method.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from resfit.errors import InputError, ResfitError

from . import METHODS


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the arguments say; see the module."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if len(given) < 3 or given[0] in ("-h", "--help"):
        width = max(len(name) for name in METHODS)
        lines = [f"  {name:{width}}  {method.DESCRIPTION}" for name, method in METHODS.items()]
        text = "\n".join(["usage: python -m resfit.eval.methods NAME MESH OUT [key=value ...]", *lines])
        asked = bool(given) and given[0] in ("-h", "--help")
        (sys.stdout if asked else sys.stderr).write(f"{text}\n")
        return 0 if asked else 2
    name, mesh, out, *pairs = given
    try:
        path = _run(name, pairs, Path(mesh), Path(out))
    except ResfitError as error:
        sys.stderr.write(f"resfit: {error}\n")
        return error.exit_code
    sys.stdout.write(f"{path}\n")
    return 0


def _run(name: str, pairs: Sequence[str], mesh: Path, out: Path) -> Path:
    """Run the method `name` with options from `key=value` texts."""
    if name not in METHODS:
        raise InputError(f"there is no method {name}; there are: {', '.join(METHODS)}.")
    options = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals or not key:
            raise InputError(f"'{pair}' is no option; write key=value.")
        options[key] = value
    return METHODS[name].run(mesh, out, options)


if __name__ == "__main__":
    sys.exit(main())
