"""`python -m resfit`."""

from __future__ import annotations

import sys

from resfit.cli import main

if __name__ == "__main__":
    sys.exit(main())
