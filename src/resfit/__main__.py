"""`python -m resfit`."""

from __future__ import annotations

import sys

if __name__ == "__main__" and not sys.flags.safe_path:
    # `-m` has put the current folder first: no numpy.py that lies there is to be executed.
    del sys.path[0]

from resfit.cli import command

if __name__ == "__main__":
    command()
