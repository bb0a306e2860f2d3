"""`resfit fit`: meshes as assemblies of primitives, each in a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Group, Parameter

from resfit.cli.progress import ProgressMode
from resfit.cli.several import fit_each
from resfit.cli.single import run_fit
from resfit.errors import InputError
from resfit.result.folder import default_folder

MORE = Group("More options", show=False)
"""Shown by --help-all only."""


def fit(
    *meshes: Annotated[Path, Parameter(required=True)],
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    preset: Literal["fast", "balanced", "best"] = "balanced",
    device: str = "auto",
    seed: int = 0,
    max_primitives: int | None = None,
    target_iou: float | None = None,
    tolerance: float | None = None,
    timeout: Annotated[float | None, Parameter(group=MORE)] = None,
    rounds: Annotated[int | None, Parameter(group=MORE)] = None,
    primitive: Annotated[str | None, Parameter(group=MORE)] = None,
    union: Annotated[Literal["smooth", "hard"] | None, Parameter(group=MORE)] = None,
    init: Annotated[Path | None, Parameter(group=MORE)] = None,
    objective: Annotated[Literal["volume", "chamfer"] | None, Parameter(group=MORE)] = None,
    decompose: Annotated[Literal["msd", "coacd"] | None, Parameter(group=MORE)] = None,
    optimizer: Annotated[Literal["levenberg", "adam"] | None, Parameter(group=MORE)] = None,
    parsimony: Annotated[float | None, Parameter(group=MORE)] = None,
    snap: Annotated[bool, Parameter(negative="")] = False,
    pareto: Annotated[bool, Parameter(negative="")] = False,
    per_part: Annotated[bool | None, Parameter(negative="--whole")] = None,
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
        preset: how much work to spend. best, about three times balanced, also takes parts that bring a third as much:
            for likeness, where parts need not be few.
        device: auto (the CPU), cpu or cuda:0.
        seed: of all random choices.
        max_primitives: give the best assembly of at most so many parts; 64 unless given.
        target_iou: stop once the assembly matches the solid this well, 0 to 1.
        tolerance: stop once 95 % of the surface is nearer than this, in the mesh's units.
        timeout: seconds after which the best so far is written; a mesh may take 10 s to be read in any case.
        rounds: most rounds of fitting.
        primitive: family to fit: superfrustum (unless given), superprimitive, superquadric, cuboid.
        union: whether parts may run into each other smoothly; smooth unless given.
        init: assembly.json, or the folder of an earlier fit, to start from.
        objective: rounds of fitting to the volume (volume, unless given), or only the parts of --init moved to lessen
            the Chamfer distance between the surfaces (chamfer).
        decompose: how to cut what is unexplained: by thickness (msd, unless given) or into convex pieces (coacd).
        optimizer: second-order steps (levenberg, unless given) or the paper's Adam (adam), which fits less well.
        parsimony: what a part must add to the objective to be worth having; about 0.0026 unless given, 0.0008 with
            best.
        snap: make the result regular: symmetry, canonical shapes, equal axes, sizes and centres.
        pareto: write the best assembly of every number of parts too; the fit itself stays as it is.
        per_part: fit the mesh's nodes, or else its bodies, one by one and keep their names; --whole never does; unless
            given, that is done where it pays.
        view: open a window that shows the fit as it happens; closing it does not stop the fit.
        open_page: open the fit's viewer.html in a browser afterwards.
        quiet: no summary and no bar; errors are told.
        progress: a bar if stderr is a terminal (auto), one JSON object a line on stderr (json), or none.
    """
    options = {
        "preset": preset,
        "device": device,
        "seed": seed,
        "max_primitives": max_primitives,
        "target_iou": target_iou,
        "tolerance": tolerance,
        "timeout": timeout,
        "rounds": rounds,
        "primitive": primitive,
        "union": union,
        "init": init,
        "objective": objective,
        "decompose": decompose,
        "optimizer": optimizer,
        "parsimony": parsimony,
        "snap": snap or None,
        "pareto": pareto or None,
        "per_part": None if per_part is None else ("on" if per_part else "off"),
    }
    if tolerance is not None and not tolerance > 0.0:
        raise InputError(f"--tolerance {tolerance:g} is out of range; it must be above 0.")
    mode = "none" if quiet and progress == "auto" else progress
    if len(meshes) == 1:
        folder = output or default_folder(meshes[0])
        return run_fit(meshes[0], folder, mode, options, view, open_page, quiet)
    for name, given in {"--init": init, "--view": view, "--open": open_page}.items():
        if given:
            raise InputError(f"{name} goes with one mesh only, and {len(meshes)} are given.")
    return fit_each(meshes, output, mode, options, quiet)
