"""`resfit help`: the same as --help, for those who try that first."""

from __future__ import annotations

from resfit.errors import InputError


def show_help(command: str | None = None, /) -> int:
    """Say what resfit, or one of its commands, can do.

    Args:
        command: one of the commands; all are listed unless given.
    """
    from resfit.cli import build_app

    app = build_app()
    if command is not None and command not in app:
        raise InputError(f"there is no command {command}; resfit help lists all.")
    app.help_print([] if command is None else [command])
    return 0
