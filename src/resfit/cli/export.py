"""`resfit export`: an assembly in other formats."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from resfit.cli.inputs import assembly_file
from resfit.errors import InputError

if TYPE_CHECKING:
    from resfit.assembly.assembly import Assembly


def export(
    assembly: Path,
    /,
    *outputs: Path,
    merged: Annotated[bool | None, Parameter(negative="--parts")] = None,
    top: int | None = None,
    resolution: int | None = None,
    mesh: Path | None = None,
    up: Literal["y", "z"] | None = None,
    device: str = "auto",
) -> int:
    """Write an assembly in other formats, chosen by suffix: .glb .obj .ply .stl .html.

    Args:
        assembly: the assembly.json to read, or the folder of a fit.
        outputs: the files to write.
        merged: one surface of the smooth union (PLY and STL unless told otherwise), or one object a part.
        top: only so many parts, the most worthwhile: by the gains in the report.json beside the assembly, or else by
            the volume that each alone holds.
        resolution: cells along the longest side, of the whole or of each part.
        mesh: the input, to be shown over the assembly in a page (.html), in at most 4000 faces.
        up: what points up in a page at first; z for formats of CAD unless given.
        device: auto (the CPU), cpu or cuda:0.
    """
    if not outputs:
        raise InputError("resfit export needs at least one file to write, such as chair.glb.")
    assembly = assembly_file(assembly)
    from resfit.assembly.assembly import Assembly
    from resfit.exports.by_suffix import PAGES, check_path, export_assembly

    for path in outputs:
        check_path(path)
    if top is not None and top < 1:
        raise InputError(f"--top {top} is out of range; it must be at least 1.")
    pages = [path for path in outputs if path.suffix.lower() in PAGES]
    if (mesh or up) and not pages:
        raise InputError("--mesh and --up are for pages; give a file to write that ends in .html.")
    whole = loaded = Assembly.load(assembly)
    if not whole.primitives:
        raise InputError(f"'{assembly}' has no parts: there is nothing to export.")
    if top is not None and top < len(whole.primitives):
        from resfit.assembly.worth import part_worths

        loaded = whole.top(top, part_worths(whole, assembly, device))
    for path in outputs:
        if path in pages:
            export_page(loaded, path, assembly.parent if loaded is whole else None, mesh, up)
        else:
            export_assembly(loaded, path, merged=merged, resolution=resolution, device=device)
    return 0


def export_page(
    assembly: Assembly, path: Path, fit: Path | None, mesh: Path | None, up: Literal["y", "z"] | None
) -> None:
    """Write a page.

    Args:
        assembly: what to show.
        path: the file to write.
        fit: the folder whose report.json tells where the assembly came from, if it does.
        mesh: file of the input.
        up: what points up at first; None goes by the input's format.
    """
    from resfit.exports.facts import at, read_report, report_facts, up_axis
    from resfit.exports.html import write_html

    report = {} if fit is None else read_report(fit)
    digest = at(report, "input", "sha256")
    if not digest or digest != assembly.provenance.input_sha256:
        # It is another assembly's report.
        report = {}
    loaded = None
    if mesh is not None:
        from resfit.shape.load import load_mesh

        loaded = load_mesh(mesh)
    source = mesh.name if mesh is not None else str(at(report, "input", "name") or "")
    facts = report_facts(report)
    write_html(assembly, path, mesh=loaded, up=up or up_axis(source), title=source or None, facts=facts)
