"""`resfit demo`: a fit of a mesh that comes with the package."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from resfit.cli.fit_options import parameter
from resfit.cli.single import run_fit
from resfit.fitter.config import Preset

MESH = "potted_cactus.glb"

FEW = 7
"""Parts at most: as many as the eye counts in it."""


def demo(
    *,
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    preset: Annotated[Preset, parameter("preset")] = "balanced",
    device: Annotated[str, parameter("device")] = "auto",
) -> int:
    """Fit at most seven parts to a mesh that comes with resfit, and write them to a folder: look at preview.png first.

    Args:
        output: folder to write; potted_cactus.resfit in the current folder unless given.
        preset: of the fit.
        device: of the fit.
    """
    from resfit.result.folder import default_folder

    with as_file(files("resfit.data") / MESH) as mesh:
        return run_fit(
            mesh,
            output or default_folder(Path(MESH)),
            "auto",
            {"preset": preset, "device": device, "max_primitives": FEW},
        )
