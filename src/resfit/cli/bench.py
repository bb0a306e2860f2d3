"""`resfit bench`: speed of this machine, how well single primitives are found, what the choices in a fit are worth."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from resfit.errors import InputError

FAILED, STOPPED = 3, 4


def bench(
    what: Literal["kernels", "recovery", "ablation"] = "kernels",
    /,
    *meshes: str,
    device: str = "auto",
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
    markdown: Path | None = None,
    count: int = 200,
    output: Annotated[Path, Parameter(name=("--output", "-o"))] = Path("ablation"),
    studies: str = "primitive,rounds,optimizer,moves",
    timeout: float = 600.0,
    fresh: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Measure this machine's speed, how well single primitives are recovered, or what each choice in a fit is worth.

    Args:
        what: "kernels" times every kernel; "recovery" fits random SuperFrusta to their own voxel grids; "ablation" fits
            meshes in variants and writes ablation.md and ablation.tex.
        meshes: of the ablation: files, folders or lists, as for resfit compare.
        device: auto, cpu or cuda:0.
        as_json: print JSON and nothing else.
        markdown: also write the table of the kernels to this file.
        count: primitives to recover.
        output: folder of the ablation; what an earlier run has finished there is not done again.
        studies: of the ablation, separated by commas: primitive (family x union), rounds (single shot or rounds x
            decomposition), optimizer (Levenberg or Adam), moves (one feature switched off a row).
        timeout: seconds a fit of the ablation; 0 is off.
        fresh: do the ablation's finished rows again.
    """
    if what == "ablation":
        return ablation(meshes, output, studies, timeout, fresh, device)
    if meshes:
        raise InputError(f"resfit bench {what} takes no meshes; only resfit bench ablation does.")
    if what == "recovery":
        from resfit.eval.bench.recovery import run_recovery

        return run_recovery(device=device, as_json=as_json, count=count)
    from resfit.eval.bench.kernels import run_kernels

    return run_kernels(device=device, as_json=as_json, markdown=markdown)


def ablation(
    meshes: tuple[str, ...], output: Path, studies: str, timeout: float, fresh: bool, device: str
) -> int:
    """Fit meshes in all variants of some studies and write the tables; see `bench`."""
    from resfit.cli.compare import brief, say
    from resfit.eval.ablation import check_studies, run_studies
    from resfit.eval.ablation_report import FILES, say_all, write_ablation
    from resfit.eval.compare import check_out
    from resfit.eval.datasets import find_shapes

    asked = check_studies(studies.split(","))
    shapes = find_shapes(meshes)
    if not shapes:
        raise InputError("there is no mesh for the ablation; give files, folders or lists of meshes.")
    check_out(output)
    total = len(shapes) * sum(len(study.variants) for study in asked)
    seen: list[dict[str, Any]] = []

    def show(row: dict[str, Any]) -> None:
        seen.append(row)
        say(f"{len(seen)}/{total} {brief(row)}")

    try:
        rows = run_studies(
            asked, shapes, output, timeout=timeout or None, device=device, fresh=fresh, on_row=show
        )
    except KeyboardInterrupt:
        say("stopped; the same command goes on from here.")
        return STOPPED
    write_ablation(rows, output)
    sys.stdout.write(say_all(rows) + f"written  {output}/ {' '.join(('rows.jsonl', *FILES))}\n")
    failed = sum(row["status"] != "ok" for row in seen)
    if failed:
        say(f"{failed} of {total} fits failed; {FILES[0]} says why.")
    return FAILED if failed else 0
