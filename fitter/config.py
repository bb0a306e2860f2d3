"""The table of the options of a fit: each is a field of `FitConfig`, which has all that is known of it.

An `Option` in the annotation of a field has its help and its legal values. The command line, the table in README.md and
the commands that a gallery shows are made from them. `FitOptions` repeats the public ones: type checkers need that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, TypedDict, get_args, get_origin, get_type_hints

from resfit.errors import InputError

from .option import Interval, Option
from .presets import ADAM, PRESETS, AdamConfig, PolishConfig, ProposeConfig, RefineConfig, SelectConfig

Preset = Literal["fast", "balanced", "best"]
Union = Literal["smooth", "hard"]
Decomposition = Literal["msd", "coacd"]
Optimizer = Literal["levenberg", "adam"]
PerPart = Literal["auto", "on", "off"]

MOST_PRIMITIVES = 64
"""Allowed in a fit unless told otherwise."""

FROM_PRESET: Any = None
"""Default of the fields that presets set: given a value, it wins over the preset."""


@dataclass(frozen=True, kw_only=True)
class FitConfig:
    """All options of a fit. What a preset sets and is not given comes from the preset.

    Raises:
        InputError: for a value that is no choice or out of range: one sentence that names the option.
    """

    preset: Annotated[
        Preset,
        Option(
            "how much work to spend; balanced unless given. best, about three times balanced, also takes parts that"
            " bring a third as much: for likeness, where parts need not be few.",
            moves=True,
        ),
    ] = "balanced"
    device: Annotated[str, Option("auto (the CPU, unless given), cpu or cuda:0.", moves=True)] = "auto"
    seed: Annotated[
        int,
        Option("of all random choices; 0 unless given.", interval=Interval(least=0, whole=True), moves=True),
    ] = 0
    primitive: Annotated[
        str,
        Option(
            "family to fit: superfrustum (unless given), superprimitive, superquadric, cuboid.", rare=True
        ),
    ] = "superfrustum"
    union: Annotated[
        Union,
        Option("whether parts may run into each other smoothly; smooth unless given.", rare=True),
    ] = "smooth"
    decompose: Annotated[
        Decomposition,
        Option(
            "how to cut what is unexplained: by thickness (msd, unless given) or into convex pieces (coacd).",
            rare=True,
        ),
    ] = "msd"
    optimizer: Annotated[
        Optimizer,
        Option(
            "second-order steps (levenberg, unless given) or the paper's Adam (adam), which fits less well.",
            rare=True,
        ),
    ] = "levenberg"
    adam: Annotated[AdamConfig, Option(idle_with={"optimizer": "levenberg"})] = ADAM
    max_primitives: Annotated[
        int,
        Option(
            "give the best assembly of at most so many parts; 64 unless given.",
            interval=Interval(least=1, whole=True),
        ),
    ] = MOST_PRIMITIVES
    target_iou: Annotated[
        float,
        Option(
            "stop once the assembly matches the solid this well, 0 to 1.",
            interval=Interval(above=0, most=1),
            idle_with={"per_part": "on"},
        ),
    ] = 1.0
    """Of a grid of 128^3 cells; 1 is off."""
    tolerance: Annotated[
        float,
        Option(
            "stop once 95 % of the surface is nearer than this, in the mesh's units.",
            interval=Interval(least=0),
            idle_with={"per_part": "on"},
        ),
    ] = 0.0
    """Compared with the 95th percentile of the two-sided surface distance; 0 is off."""
    timeout: Annotated[
        float,
        Option(
            "seconds after which the best so far is written; a mesh may take 10 s to be read in any case.",
            interval=Interval(least=0),
            rare=True,
            moves=True,
        ),
    ] = 0.0
    """0 is off."""
    rounds: Annotated[
        int, Option("most rounds of fitting.", interval=Interval(least=1, most=100, whole=True), rare=True)
    ] = FROM_PRESET
    probes: Annotated[bool, Option(idle_with={"optimizer": "adam"})] = True
    """Whether refinement watches points where primitives stick out of the target."""
    excursions: int = FROM_PRESET
    """Further beginnings of the search, before what all found is put together: every other one from nothing."""
    parsimony: Annotated[
        float,
        Option(
            "what a part must add to the objective to be worth having; about 0.0026 unless given, 0.0008 with best.",
            interval=Interval(least=0, below=1),
            rare=True,
            moves=True,
        ),
    ] = FROM_PRESET
    snap: Annotated[
        bool,
        Option(
            "make the result regular: symmetry, canonical shapes, equal axes, sizes and centres.",
            flags={"--snap": True},
        ),
    ] = False
    pareto: Annotated[
        bool,
        Option(
            "write the best assembly of every number of parts too; the fit itself stays as it is.",
            flags={"--pareto": True},
        ),
    ] = False
    per_part: Annotated[
        PerPart,
        Option(
            "fit the mesh's nodes, or else its bodies, one by one and keep their names; --whole never does; unless"
            " given, that is done where it pays.",
            flags={"--per-part": "on", "--whole": "off"},
        ),
    ] = "auto"
    resolution: Annotated[int, Option(moves=True)] = 128
    samples: Annotated[int, Option(moves=True)] = FROM_PRESET
    """Points near the surface, and as many in the volume, that the objective is measured on."""
    propose: ProposeConfig = FROM_PRESET
    select: Annotated[SelectConfig, Option(idle_with={"optimizer": "adam"})] = FROM_PRESET
    refine: Annotated[RefineConfig, Option(idle_with={"optimizer": "adam"})] = FROM_PRESET
    """In rich rounds, which find where things go."""
    sharpen: Annotated[RefineConfig, Option(idle_with={"optimizer": "adam"})] = FROM_PRESET
    """In plain rounds."""
    polish: PolishConfig = FROM_PRESET

    def __post_init__(self) -> None:
        OPTIONS["preset"].check(self.preset, CHOICES["preset"], "preset")
        for name, value in PRESETS[self.preset].items():
            if getattr(self, name) is FROM_PRESET:
                object.__setattr__(self, name, value)
        for name, entry in OPTIONS.items():
            entry.check(getattr(self, name), CHOICES.get(name, ()))
        # Modules of commands load this table for their help, and no kernel.
        from ..kernels.primitives import FAMILIES

        OPTIONS["primitive"].check(self.primitive, tuple(FAMILIES), "family")
        if self.propose.without:
            from ..decomposition.proposals import check_without

            check_without(self.propose.without)

    def changed(self) -> list[tuple[str, Option]]:
        """The options that are not as their preset has them, each by its name in messages."""
        usual, found = FitConfig(preset=self.preset), []
        for name, entry in OPTIONS.items():
            value = getattr(self, name)
            if value != getattr(usual, name):
                found.append((entry.spelled(value), entry))
        return found

    def check_effect(self) -> None:
        """Refuse an option that another one leaves without effect.

        Raises:
            InputError: if there is one, by its name.
        """
        for spelled, entry in self.changed():
            for name, value in entry.idle_with.items():
                if getattr(self, name) == value:
                    other = " ".join(OPTIONS[name].words(value))
                    raise InputError(
                        f"{spelled} has no effect with {other}; leave out or change one of them."
                    )


class FitOptions(TypedDict, total=False):
    """The public options as keywords of `resfit.fit`; None leaves one as it is."""

    device: str | None
    seed: int | None
    primitive: str | None
    union: Union | None
    decompose: Decomposition | None
    optimizer: Optimizer | None
    max_primitives: int | None
    target_iou: float | None
    tolerance: float | None
    timeout: float | None
    rounds: int | None
    parsimony: float | None
    snap: bool | None
    pareto: bool | None
    per_part: PerPart | None


TYPES: dict[str, Any] = get_type_hints(FitConfig)
"""Type of each option by its name."""


def _table() -> dict[str, Option]:
    found = {}
    for name, hint in get_type_hints(FitConfig, include_extras=True).items():
        (entry,) = getattr(hint, "__metadata__", (Option(),))
        found[name] = replace(entry, name=name)
    return found


OPTIONS: dict[str, Option] = _table()
"""The table: every option by its name."""

PUBLIC: dict[str, Option] = {name: entry for name, entry in OPTIONS.items() if entry.public}
"""Those that are keywords of `resfit.fit` and options of the command line."""

CHOICES: dict[str, tuple[str, ...]] = {
    name: get_args(kind) for name, kind in TYPES.items() if get_origin(kind) is Literal
}
"""Values of the options that are one of a few words."""


def preset_config(preset: str = "balanced", **options: Any) -> FitConfig:
    """The configuration of a preset with the given options changed; None leaves an option as the preset has it.

    Raises:
        InputError: for an unknown preset or a value out of range.
    """
    return FitConfig(preset=preset, **{name: value for name, value in options.items() if value is not None})  # type: ignore[arg-type]
