"""Run one method on one mesh: `python -m resfit.eval.methods NAME[:key=value,...] MESH OUT [key=value ...]`.

Writes the path of the result to stdout. Exit codes: 0 done, 2 unusable input, option or missing package (a sentence on
stderr); anything else is a defect or a crash of the method.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from resfit.errors import ResfitError

from . import METHODS, find_method, read_pairs


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the arguments say; see the module."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if len(given) < 3 or given[0] in ("-h", "--help"):
        width = max(len(name) for name in METHODS)
        lines = [f"  {name:{width}}  {method.DESCRIPTION}" for name, method in METHODS.items()]
        text = "\n".join(
            ["usage: python -m resfit.eval.methods NAME[:key=value,...] MESH OUT [key=value ...]", *lines]
        )
        asked = bool(given) and given[0] in ("-h", "--help")
        (sys.stdout if asked else sys.stderr).write(f"{text}\n")
        return 0 if asked else 2
    name, mesh, out, *pairs = given
    try:
        path = find_method(name).run(Path(mesh), Path(out), read_pairs(pairs))
    except ResfitError as error:
        sys.stderr.write(f"resfit: {error}\n")
        return error.exit_code
    sys.stdout.write(f"{path}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
