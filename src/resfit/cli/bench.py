"""`resfit bench`: speed here of kernels, fits and edits, finding single primitives, worth of the choices."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from resfit.cli.failures import FAILED, STOPPED
from resfit.cli.terminal import summarise
from resfit.errors import InputError


def bench(
    what: Literal["kernels", "fit", "recovery", "ablation", "view"] = "kernels",
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
    preset: Literal["fast", "balanced", "best"] = "balanced",
    repeats: int = 3,
    cold: Annotated[bool, Parameter(negative="")] = False,
    one_core: Annotated[bool, Parameter(negative="")] = False,
    grow: Annotated[bool, Parameter(negative="")] = False,
    sizes: str = "",
) -> int:
    """Measure speed here, a fit by stage, how well single primitives are recovered, or what each choice is worth.

    Args:
        what: "kernels" times every kernel; "fit" times whole fits by stage; "recovery" fits random SuperFrusta to their
            own voxel grids; "ablation" fits meshes in variants and writes ablation.md and ablation.tex; "view" times
            how long edits take to show.
        meshes: of fit and the ablation: files, folders or lists, as for resfit compare; fit takes the bundled ones if
            there are none.
        device: auto (the CPU), cpu or cuda:0.
        as_json: print JSON and nothing else.
        markdown: also write the tables of the kernels or of fit to this file, and fit's chart of growth beside it.
        count: primitives to recover.
        output: folder of the ablation; what an earlier run has finished there is not done again.
        studies: of the ablation, separated by commas: primitive (family x union), rounds (single shot or rounds x
            decomposition), optimizer (Levenberg or Adam), moves (one feature switched off a row).
        timeout: seconds a fit of the ablation or of fit; 0 is off.
        fresh: do the ablation's finished rows again.
        preset: of fit.
        repeats: runs of each fit, whose median is shown.
        cold: of fit: also compile all kernels into an empty cache.
        one_core: of fit: also fit on one core, for the speed-up of all.
        grow: of fit: also how the stages grow with the faces, the grid, the primitives, the samples, and the
            triangles of a soup.
        sizes: what grows, and how far: "faces=1k,16k,1M grid=64,128,256 primitives=8,64 samples=4k,64k soup=3000"; a
            few sizes of all five unless given.
    """
    if what == "ablation":
        return ablation(meshes, output, studies, timeout, fresh, device)
    if what == "fit":
        return fits(
            meshes,
            preset,
            repeats,
            device,
            timeout,
            cold,
            one_core,
            sizes if grow else None,
            as_json,
            markdown,
        )
    if meshes:
        raise InputError(f"resfit bench {what} takes no meshes; only resfit bench fit and ablation do.")
    if what == "recovery":
        from resfit.eval.bench.recovery import run_recovery

        return run_recovery(device=device, as_json=as_json, count=count)
    if what == "view":
        return views(device, as_json)
    from resfit.eval.bench.kernels import run_kernels

    return run_kernels(device=device, as_json=as_json, markdown=markdown)


def views(device: str, as_json: bool) -> int:
    """Time how long edits take to show in `resfit view`."""
    from resfit.viewer.bench import as_dict, describe, measure_view

    times = measure_view(device=device)
    sys.stdout.write(json.dumps(as_dict(times), indent=2) + "\n" if as_json else describe(times))
    return 0


def fits(
    meshes: tuple[str, ...],
    preset: str,
    repeats: int,
    device: str,
    timeout: float,
    cold: bool,
    one_core: bool,
    sizes: str | None,
    as_json: bool,
    markdown: Path | None,
) -> int:
    """Time whole fits by stage; `sizes` is None where nothing is to grow. See `bench`."""
    from resfit.cli.compare import say
    from resfit.eval.bench.fit import run_fit_bench
    from resfit.eval.bench.growth import read_sizes

    if repeats < 1:
        raise InputError(f"--repeats {repeats} is out of range; it must be at least 1.")
    if markdown is not None and not markdown.parent.is_dir():
        raise InputError(f"--markdown {markdown}: there is no folder {markdown.parent}.")
    try:
        rows = run_fit_bench(
            meshes,
            preset=preset,
            repeats=repeats,
            device=device,
            timeout=timeout or None,
            cold=cold,
            one_core=one_core,
            sizes=None if sizes is None else read_sizes(sizes),
            as_json=as_json,
            markdown=markdown,
        )
    except KeyboardInterrupt:
        say("stopped.")
        return STOPPED
    failed = sum(row.status != "ok" for row in rows)
    if failed:
        say(f"{failed} of {len(rows)} fits failed; the table says why.")
    return FAILED if failed else 0


def ablation(
    meshes: tuple[str, ...], output: Path, studies: str, timeout: float, fresh: bool, device: str
) -> int:
    """Fit meshes in all variants of some studies and write the tables; see `bench`."""
    from resfit.cli.compare import brief, say
    from resfit.eval.batch.compare import check_out
    from resfit.eval.batch.datasets import find_shapes
    from resfit.eval.bench.ablation import check_studies, run_studies
    from resfit.eval.bench.ablation_report import FILES, say_all, write_ablation

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
    summarise(say_all(rows) + f"written  {output}/ {' '.join(('rows.jsonl', *FILES))}\n")
    failed = sum(row["status"] != "ok" for row in seen)
    if failed:
        say(f"{failed} of {total} fits failed; {FILES[0]} says why.")
    return FAILED if failed else 0
