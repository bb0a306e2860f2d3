"""See and edit assemblies: a model without windows, scenes of VTK actors, and the desktop window around both."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import web

__all__ = ["web"]


def __getattr__(name: str) -> Any:
    # For `resfit.viewer.web.show` in a notebook that has only imported resfit.
    if name == "web":
        return import_module(".web", __name__)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
