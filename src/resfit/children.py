"""Starting Python in another process. Imports nothing heavy."""

from __future__ import annotations

import sys


def python_command(*arguments: str) -> list[str]:
    """The command line of this Python with arguments such as `-c CODE`, for every child process of ours.

    With `-P`: `-c` and `-m` look for modules in the current folder first otherwise, and would execute whatever
    numpy.py came along with a mesh.
    """
    return [sys.executable, "-P", *arguments]
