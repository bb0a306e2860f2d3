"""`resfit fit`: meshes as assemblies of primitives, each in a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from resfit.cli.fit_options import MORE, FitArguments, values
from resfit.cli.progress import ProgressMode
from resfit.cli.several import fit_each
from resfit.cli.single import run_fit
from resfit.errors import InputError
from resfit.result.folder import default_folder


def fit(
    *meshes: Annotated[Path, Parameter(required=True)],
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    fitting: Annotated[FitArguments | None, Parameter(name="*")] = None,
    init: Annotated[Path | None, Parameter(group=MORE)] = None,
    objective: Annotated[Literal["volume", "chamfer"] | None, Parameter(group=MORE)] = None,
    view: Annotated[bool, Parameter(negative="")] = False,
    open_page: Annotated[bool, Parameter(name="--open", negative="")] = False,
    quiet: Annotated[bool, Parameter(name=("--quiet", "-q"), negative="")] = False,
    progress: Annotated[ProgressMode, Parameter(group=MORE)] = "auto",
) -> int:
    """Fit an assembly of primitives to each mesh, and write it to a folder.

    Ctrl-C keeps the best so far, if the mesh is read by then, and begins no other mesh; a second one aborts. More
    options: resfit fit --help-all.

    Args:
        meshes: .glb .gltf .obj .ply .stl .off .3mf, or one of them packed: .zip .tar .gz .tgz .bz2 .tbz2. Several are
            fitted one after the other.
        output: folder to write, which may hold an earlier fit; STEM.resfit in the current folder unless given. Of
            several meshes: the folder that these come to lie in.
        fitting: options of the fit itself.
        init: assembly.json, or the folder of an earlier fit, to start from.
        objective: rounds of fitting to the volume (volume, unless given), or only the parts of --init moved to lessen
            the Chamfer distance between the surfaces (chamfer).
        view: open a window that shows the fit as it happens; closing it does not stop the fit.
        open_page: open the fit's viewer.html in a browser afterwards.
        quiet: no summary and no bar; errors are told.
        progress: a bar if stderr is a terminal (auto), one JSON object a line on stderr (json), or none.
    """
    options = values(fitting)
    if (tolerance := options.get("tolerance")) is not None and not tolerance > 0.0:
        raise InputError(f"--tolerance {tolerance:g} is out of range; it must be above 0.")
    options |= {"init": init, "objective": objective}
    mode = "none" if quiet and progress == "auto" else progress
    if len(meshes) == 1:
        folder = output or default_folder(meshes[0])
        return run_fit(meshes[0], folder, mode, options, view, open_page, quiet)
    for name, given in {"--init": init, "--view": view, "--open": open_page}.items():
        if given:
            raise InputError(f"{name} goes with one mesh only, and {len(meshes)} are given.")
    return fit_each(meshes, output, mode, options, quiet)
