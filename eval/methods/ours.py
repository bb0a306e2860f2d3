"""Residual Primitive Fitting itself, under the contract of the methods that it is compared with."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .options import output_folder, read_options

NAME = "ours"
DESCRIPTION = "this package's fit, preset balanced"


def run(mesh_path: Path, out: Path, options: Mapping[str, Any]) -> Path:
    """Fit a mesh and write `assembly.json`: the parts that `resfit fit` finds with the same options.

    What a fit does beyond that (pictures, reports, measurements) is left out, so that the cost is the method's own.

    Args:
        mesh_path: what to fit.
        out: folder for the result.
        options: `preset` (balanced), `rounds` (0: as the preset has it), `primitive`, `seed`, `device`.

    Raises:
        InputError: if the mesh cannot be read or holds nothing solid, or an option makes no sense.
    """
    from ...assembly.assembly import Assembly
    from ...assembly.colors import palette_color
    from ...assembly.provenance import Provenance
    from ...fitter.config import preset_config
    from ...fitter.loop import fit_target
    from ...kernels.launch import choose_device
    from ...target.target import make_target

    defaults = {"preset": "balanced", "rounds": 0, "primitive": "superfrustum", "seed": 0, "device": "auto"}
    chosen = read_options(options, defaults)
    config = preset_config(
        chosen["preset"],
        rounds=chosen["rounds"] or None,
        primitive=chosen["primitive"],
        seed=chosen["seed"],
        device=chosen["device"],
    )
    device = choose_device(config.device)
    target = make_target(mesh_path, device, config.resolution, config.samples, config.seed)
    outcome = fit_target(target, config, device)
    recorded = {name: chosen[name] for name in ("preset", "primitive")} | {"rounds": config.rounds}
    provenance = Provenance.current(
        seed=config.seed, options={"method": NAME, **recorded}, input_sha256=target.input_sha256
    )
    colors = [palette_color(index) for index in range(len(outcome.rows))]
    assembly = Assembly.from_rows(outcome.rows, outcome.families, colors, target.transform, provenance)
    path = output_folder(out) / "assembly.json"
    assembly.save(path)
    return path
