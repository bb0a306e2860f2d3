"""`resfit eval`: how well a reconstruction matches a mesh."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

LINES: tuple[tuple[str, str, str], ...] = (
    ("surface_mean", "mean distance", "{:.5f}  between the surfaces; the longest side is 1.8"),
    ("surface_p95", "95 % within", "{:.5f}"),
    ("surface_max", "farthest", "{:.5f}"),
    ("iou", "IoU", "{:.4f}"),
    ("bisurf_iou", "BiSurfIoU", "{:.4f}  within about 0.02 of the surfaces"),
    ("bisurf_iou_005", "BiSurfIoU 0.05", "{:.4f}"),
    ("cd", "Chamfer distance", "{:.4f}  two samples of the target itself: {cd_floor:.4f}"),
    ("emd", "earth mover's", "{:.4f}  differences under 0.01 mean nothing"),
    ("primitive_count", "primitives", "{:d}"),
    ("overlap", "overlap", "{:.4f}"),
    ("unoverlap", "unoverlap", "{:.4f}"),
    ("intra_prim", "IntraPrim", "{:.4f}"),
    ("inter_prim", "InterPrim", "{:.4f}"),
    ("floats", "floats", "{:d}  numbers that store it"),
)
"""Key of the row, what it is called, and how it is shown, in the order of a closed target but for the first three."""


def evaluate(
    prediction: Path,
    target: Path,
    /,
    *,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
    align: Literal["none", "bbox"] = "none",
    emd: Annotated[bool, Parameter(name="--emd", negative="--no-emd")] = True,
    features: str | None = None,
    device: str = "auto",
) -> int:
    """Score a reconstruction of a mesh: IoU, BiSurfIoU, Chamfer and earth mover's distance, parts, overlap.

    Args:
        prediction: assembly.json, the folder of a fit, or a mesh or scene whose nodes or bodies are the parts.
        target: the mesh that it should match.
        as_json: print JSON and nothing else.
        align: bbox scales and moves the prediction's box onto the target's first.
        emd: the earth mover's distance takes about as long as all the rest.
        features: for IntraPrim and InterPrim: a command with {mesh} {points} {out} (.npy files), a .npz file with
            points and features, or the name of an installed source.
        device: auto (the CPU), cpu or cuda:0.
    """
    from resfit import evaluate as measure

    row = measure(prediction, target, align=align, emd=emd, features=features, device=device)
    for note in row["notes"]:
        sys.stderr.write(f"resfit: {note}\n")
    sys.stdout.write(json.dumps(row, indent=2, allow_nan=False) + "\n" if as_json else table(row))
    return 0


def table(row: dict[str, Any]) -> str:
    """The row for people; what was not measured is left out.

    Args:
        row: what `resfit.evaluate` returned.
    """
    lines = LINES if not row["closed"] else (*LINES[3:8], *LINES[:3], *LINES[8:])
    width = max(len(name) for _, name, _ in LINES)
    shown = [f"target  {row['target_rule']}"]
    if not row["closed"]:
        shown.append(
            "        An open mesh: look at the distances to its faces first, since a thick shell is easy to match."
        )
    for key, name, style in lines:
        if row[key] is not None:
            shown.append(f"{name:>{width}}  {style.format(row[key], **row)}")
    return "\n".join(shown) + "\n"
