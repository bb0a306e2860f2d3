"""ResFit: any 3D mesh as a compact, editable assembly of analytic primitives.

Public names load on first use: Warp and trimesh alone take over a second.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from resfit.loading import without_collector

if TYPE_CHECKING:
    from resfit import viewer
    from resfit.api import evaluate, export, fit
    from resfit.assembly.assembly import Assembly
    from resfit.assembly.primitive import Pose, Primitive
    from resfit.assembly.transform import Transform
    from resfit.errors import ResfitError
    from resfit.fitter.config import FitConfig
    from resfit.result.fit_result import FitResult

    __version__: str

__all__ = [
    "Assembly",
    "FitConfig",
    "FitResult",
    "Pose",
    "Primitive",
    "ResfitError",
    "Transform",
    "__version__",
    "evaluate",
    "export",
    "fit",
    "viewer",
]

_HOMES = {
    "Assembly": "resfit.assembly.assembly",
    "FitConfig": "resfit.fitter.config",
    "FitResult": "resfit.result.fit_result",
    "Pose": "resfit.assembly.primitive",
    "Primitive": "resfit.assembly.primitive",
    "ResfitError": "resfit.errors",
    "Transform": "resfit.assembly.transform",
    "evaluate": "resfit.api",
    "export": "resfit.api",
    "fit": "resfit.api",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("resfit")
    if name == "viewer":
        return import_module("resfit.viewer")
    if name not in _HOMES:
        raise AttributeError(f"module 'resfit' has no attribute '{name}'")
    with without_collector():
        value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
