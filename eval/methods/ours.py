"""Residual Primitive Fitting itself, under the contract of the methods that it is compared with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin, get_type_hints

from resfit.errors import InputError

from .options import output_folder

if TYPE_CHECKING:
    from ...fitter.config import FitConfig

NAME = "ours"
DESCRIPTION = "this package's fit, preset balanced"

WORDS = tuple[str, ...]
"""Type of options that are several words, written with + between them."""


def run(mesh_path: Path, out: Path, options: Mapping[str, Any]) -> Path:
    """Fit a mesh and write `assembly.json`: the parts that `resfit fit` finds with the same options.

    What a fit does beyond that (pictures, reports, measurements) is left out, so that the cost is the method's own.

    Args:
        mesh_path: what to fit.
        out: folder for the result.
        options: any field of `FitConfig` that is one number or word, or words joined by +; those of its stages as
            `refine.overlap`.

    Raises:
        InputError: if the mesh cannot be read or holds nothing solid, or an option makes no sense.
    """
    from ...assembly.assembly import Assembly
    from ...assembly.colors import palette_color
    from ...assembly.provenance import Provenance
    from ...fitter.pipeline import fit_stages
    from ...kernels.runtime.launch import choose_device
    from ...shape.target import make_target

    config = configuration(options)
    device = choose_device(config.device)
    target = make_target(mesh_path, device, config.resolution, config.samples, config.seed)
    outcome = fit_stages(target, config, device).outcome
    recorded = {"preset": config.preset, "primitive": config.primitive, "rounds": config.rounds}
    recorded |= {name: str(value) for name, value in options.items() if name not in recorded}
    provenance = Provenance.current(
        seed=config.seed, options={"method": NAME, **recorded}, input_sha256=target.input_sha256
    )
    colors = [palette_color(index) for index in range(len(outcome.rows))]
    assembly = Assembly.from_rows(outcome.rows, outcome.families, colors, target.transform, provenance)
    path = output_folder(out) / "assembly.json"
    assembly.save(path)
    return path


def configuration(options: Mapping[str, Any]) -> FitConfig:
    """The configuration of a preset with some of its fields changed.

    Args:
        options: `preset` and other fields by name; a stage's own fields as `stage.field`. Values may be text.

    Raises:
        InputError: for a field that does not exist or holds several values, a value that does not fit it, or an option
            that another one leaves without effect.
    """
    from ...fitter.config import preset_config

    config = preset_config(str(options.get("preset", "balanced")))
    stages: dict[str, dict[str, Any]] = {}
    changes: dict[str, Any] = {}
    for name, value in options.items():
        stage, dot, own = name.rpartition(".")
        holder = getattr(config, stage, None) if dot else config
        if not is_dataclass(holder) or own not in _scalars(holder):
            raise InputError(
                f"the method has no option {name}; there are: {', '.join(known_options(config))}."
            )
        read = _read(name, value, _scalars(holder)[own])
        (stages.setdefault(stage, {}) if dot else changes)[own] = read
    for stage, own in stages.items():
        changes[stage] = replace(getattr(config, stage), **own)
    changed = replace(config, **changes)
    changed.check_effect()
    return changed


def known_options(config: FitConfig) -> list[str]:
    """Names of everything that `configuration` can change."""
    names = list(_scalars(config))
    for field in fields(config):
        holder = getattr(config, field.name)
        if is_dataclass(holder):
            names += [f"{field.name}.{name}" for name in _scalars(holder)]
    return names


def _scalars(holder: Any) -> dict[str, Any]:
    """Type of each field of a configuration that is one number or word, or holds words."""
    hints = get_type_hints(type(holder))
    single = {name: hint for name, hint in hints.items() if name in {field.name for field in fields(holder)}}
    return {
        name: hint
        for name, hint in single.items()
        if hint in (bool, int, float, str, WORDS) or get_origin(hint) is Literal
    }


def _read(name: str, value: Any, hint: Any) -> Any:
    """A value, perhaps text, as its field wants it."""
    if get_origin(hint) is Literal:
        if value not in get_args(hint):
            raise InputError(f"option {name} is {value!r}; choose {', '.join(get_args(hint))}.")
        return value
    if hint == WORDS:
        return tuple(str(value).split("+"))
    if hint is bool:
        words = {"true": True, "1": True, "yes": True, "false": False, "0": False, "no": False}
        if str(value).lower() not in words:
            raise InputError(f"option {name} is {value!r}; it must be true or false.")
        return words[str(value).lower()]
    try:
        return hint(value)
    except (TypeError, ValueError):
        wanted = {int: "a whole number", float: "a number"}[hint]
        raise InputError(f"option {name} is {value!r}; it must be {wanted}.") from None
