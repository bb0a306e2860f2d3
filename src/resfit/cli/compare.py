"""`resfit compare`: methods on the same meshes, in tables, a plot and a picture."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from resfit.cli.failures import FAILED, STOPPED
from resfit.cli.terminal import summarise
from resfit.errors import InputError


def compare(
    *meshes: str,
    methods: str = "ours,mps,coacd",
    output: Annotated[Path, Parameter(name=("--output", "-o"))] = Path("comparison"),
    select: int | None = None,
    timeout: float = 600.0,
    emd: Annotated[bool, Parameter(name="--emd", negative="--no-emd")] = True,
    features: str | None = None,
    fresh: Annotated[bool, Parameter(negative="")] = False,
    device: str = "auto",
) -> int:
    """Fit meshes by several methods, one process a fit, score them, and write tables, a plot and a picture.

    What an earlier run into the same folder has finished is not done again.

    Args:
        meshes: files, folders, lists (.txt, one path a line), or a data set's folder after its layout, such as
            toys4k:/data/toys4k_obj_files; layouts are folder, toys4k, 3dgen, abc and partobjaverse.
        methods: names, separated by commas; resfit compare --methods help lists them. ours:key=value,key=value changes
            options of a fit, such as ours:union=hard,refine.overlap=0.
        output: folder for rows.jsonl, tables.md, tables.tex, pareto.svg, sheet.png and every method's results.
        select: take only so many meshes, as unlike each other as can be (farthest-point selection).
        timeout: seconds a fit; 0 is off.
        emd: whether to compute the earth mover's distance.
        features: for IntraPrim and InterPrim, as in resfit eval.
        fresh: do finished rows again.
        device: of the metrics: auto (the CPU), cpu or cuda:0.
    """
    from resfit.eval.batch.compare import Comparison, check_methods, check_out, run_comparison
    from resfit.eval.batch.datasets import find_shapes, select_diverse
    from resfit.eval.methods import split_methods
    from resfit.eval.report.comparison import FILES, write_report

    known = known_methods()
    if methods == "help":
        sys.stdout.write("".join(f"{name:<14} {text}\n" for name, text in known.items()))
        return 0
    asked = check_methods(split_methods(methods), known)
    shapes = find_shapes(meshes)
    if not shapes:
        raise InputError("there is no mesh to compare on; give files, folders or lists of meshes.")
    check_out(output)
    if select is not None:
        shapes = select_diverse(
            shapes, select, lambda shape, reason: say(f"{shape.name} is left out: {reason}")
        )
        if not shapes:
            raise InputError("none of the meshes can be read.")
    comparison = Comparison(output, asked, timeout or None, emd, features, device, fresh)
    rows: list[dict[str, Any]] = []
    total = len(shapes) * len(asked)

    def show(row: dict[str, Any]) -> None:
        rows.append(row)
        say(f"{len(rows)}/{total} {brief(row)}")

    code = 0
    try:
        run_comparison(comparison, shapes, show)
    except KeyboardInterrupt:
        code = STOPPED
    if rows:
        write_report(rows, shapes, output)
        summarise(f"{summary(rows)}written  {output}/ {' '.join(('rows.jsonl', *FILES))}\n")
    failed = [row for row in rows if row["status"] != "ok"]
    if failed:
        say(f"{len(failed)} of {total} fits failed; rows.jsonl and tables.md say why.")
    return code or (FAILED if failed else 0)


def known_methods() -> dict[str, str]:
    """Descriptions of methods, by name."""
    from resfit.eval import methods

    found = getattr(methods, "METHODS", {})
    if not isinstance(found, dict):
        return {str(getattr(entry, "NAME", entry)): str(getattr(entry, "DESCRIPTION", "")) for entry in found}
    return {name: str(getattr(entry, "DESCRIPTION", "")) for name, entry in found.items()}


def brief(row: dict[str, Any]) -> str:
    """A row in one line."""
    who = f"{row['mesh']}, {row['method']}:"
    if row["status"] != "ok":
        return f"{who} {row['error']}"
    return f"{who} IoU {row['iou']:.3f}, {row['primitive_count']} parts, {row['cpu_s']:.1f} CPU s"


def summary(rows: list[dict[str, Any]]) -> str:
    """Means of the methods, for people.

    Args:
        rows: of the comparison.
    """
    from resfit.eval.report.tables import tables_of

    tables = tables_of(rows)
    if not tables:
        return "no fit was finished\n"
    # In short where there are closed meshes that all finished, else the first there is.
    table = next((found for found in tables if found.title.endswith("in short")), tables[0])
    width = max(len(method) for method, _ in table.lines) + 2
    lines = [table.title, " " * width + "".join(f"{column.heading:>15}" for column in table.columns)]
    for method, values in table.lines:
        shown = [
            "-" if value is None else format(value, column.style)
            for value, column in zip(values, table.columns, strict=True)
        ]
        lines.append(f"{method:<{width}}" + "".join(f"{text:>15}" for text in shown))
    return "\n".join(lines) + "\n"


def say(sentence: str) -> None:
    """One line on stderr."""
    sys.stderr.write(f"resfit: {' '.join(sentence.split())}\n")
