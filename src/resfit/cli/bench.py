"""`resfit bench`: how fast this machine is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter


def bench(
    what: Literal["kernels"] = "kernels",
    /,
    *,
    device: str = "auto",
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
    markdown: Path | None = None,
) -> int:
    """Measure the speed of the kernels on this machine.

    Args:
        what: what to measure.
        device: auto, cpu or cuda:0.
        as_json: print JSON and nothing else.
        markdown: also write the table to this file.
    """
    from resfit.eval.bench import run_kernels

    return run_kernels(device=device, as_json=as_json, markdown=markdown) or 0
