"""`resfit bench`: how fast this machine is, and how well single primitives are found."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter


def bench(
    what: Literal["kernels", "recovery"] = "kernels",
    /,
    *,
    device: str = "auto",
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
    markdown: Path | None = None,
    count: int = 200,
) -> int:
    """Measure this machine's speed, or how well single random primitives are recovered.

    Args:
        what: "kernels" times every kernel; "recovery" fits random SuperFrusta to their own voxel grids.
        device: auto, cpu or cuda:0.
        as_json: print JSON and nothing else.
        markdown: also write the table of the kernels to this file.
        count: primitives to recover.
    """
    if what == "recovery":
        from resfit.eval.bench.recovery import run_recovery

        return run_recovery(device=device, as_json=as_json, count=count)
    from resfit.eval.bench.kernels import run_kernels

    return run_kernels(device=device, as_json=as_json, markdown=markdown)
