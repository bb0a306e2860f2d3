"""A page in the user's own browser."""

from __future__ import annotations

from pathlib import Path

from resfit.cli.terminal import tell


def open_in_browser(page: Path) -> None:
    """Open a file in a browser, or say where it lies."""
    import webbrowser

    try:
        opened = webbrowser.open(page.absolute().as_uri())
    except (webbrowser.Error, OSError):
        opened = False
    if not opened:
        tell(f"resfit: there is no browser here; the page is {page}.")
