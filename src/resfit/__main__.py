"""`python -m resfit`."""

from __future__ import annotations

from resfit.cli import command

if __name__ == "__main__":
    command()
