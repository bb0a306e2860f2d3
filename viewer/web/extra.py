"""Check that the packages of the extra `web` are there."""

from __future__ import annotations

from importlib.util import find_spec

from resfit.errors import InputError
from resfit.extras import command_for

PACKAGES = ("trame", "trame_vuetify", "trame_rca", "aiohttp")
"""What is imported of the extra: trame-pyvista brings all but the second."""


def require_web() -> None:
    """Refuse to go on without the extra.

    Raises:
        InputError: one sentence that says how to get it.
    """
    if not all(find_spec(name) for name in PACKAGES):
        raise InputError(
            f"the page needs packages that are not installed; call {command_for('web')} to get them."
        )
