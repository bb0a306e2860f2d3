"""One file per format. The package itself can be called: `resfit.export(assembly, "chair.glb")`.

`resfit.export` names both this folder and the public function; once a module of the folder is imported, Python makes
the name mean the folder. So the folder is made callable, and the name does the same before and after.
"""

from __future__ import annotations

import sys
import types
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..assembly.assembly import Assembly


class CallablePackage(types.ModuleType):
    """A package that is also the function `export_assembly`."""

    def __call__(self, assembly: Assembly, path: str | Path, **options: Any) -> None:
        """See `resfit.export.by_suffix.export_assembly`."""
        from .by_suffix import export_assembly

        export_assembly(assembly, path, **options)


sys.modules[__name__].__class__ = CallablePackage
