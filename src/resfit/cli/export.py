"""`resfit export`: an assembly in other formats."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from resfit.cli.inputs import assembly_file
from resfit.errors import InputError

if TYPE_CHECKING:
    from resfit.assembly.assembly import Assembly
    from resfit.exports.exporter import ExportOptions


def export(
    assembly: Path,
    /,
    *outputs: Path,
    merged: Annotated[bool | None, Parameter(negative="--parts")] = None,
    top: int | None = None,
    resolution: int | None = None,
    mesh: Path | None = None,
    up: Literal["y", "z"] | None = None,
    device: str | None = None,
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
        device: auto (the CPU, unless given), cpu or cuda:0.
    """
    if not outputs:
        raise InputError("resfit export needs at least one file to write, such as chair.glb.")
    assembly = assembly_file(assembly)
    from resfit.assembly.assembly import Assembly
    from resfit.exports.by_suffix import check_options, check_path, export_assembly

    given = {"merged": merged, "resolution": resolution, "mesh": mesh, "up": up}
    # The worth of parts is measured on it too.
    given |= {"device": device} if top is None else {}
    check_options(outputs, [name for name, value in given.items() if value is not None])
    if top is not None and top < 1:
        raise InputError(f"--top {top} is out of range; it must be at least 1.")
    whole = loaded = Assembly.load(assembly)
    if not whole.primitives:
        raise InputError(f"'{assembly}' has no parts: there is nothing to export.")
    if top is not None and top < len(whole.primitives):
        from resfit.assembly.worth import part_worths

        loaded = whole.top(top, part_worths(whole, assembly, device or "auto"))
    options = {"merged": merged, "resolution": resolution, "device": device}
    if any("facts" in check_path(path).options for path in outputs):
        options |= page_options(loaded, assembly.parent if loaded is whole else None, mesh, up)
    for path in outputs:
        taken = check_path(path).options
        export_assembly(loaded, path, **{name: value for name, value in options.items() if name in taken})
    return 0


def page_options(
    assembly: Assembly, fit: Path | None, mesh: Path | None, up: Literal["y", "z"] | None
) -> ExportOptions:
    """The options of a page.

    Args:
        assembly: what to show.
        fit: the folder whose report.json tells where the assembly came from, if it does.
        mesh: file of the input.
        up: what points up at first; None goes by the input's format.
    """
    from resfit.exports.facts import at, read_report, report_facts, up_axis

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
    return {"mesh": loaded, "up": up or up_axis(source), "title": source or None, "facts": facts}
