"""What steers a fit. Stage settings sit here in one place because presets change several of them together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from resfit.errors import InputError

from ..kernels.primitives import DEFAULT_FAMILY, FAMILIES

Preset = Literal["fast", "balanced", "best"]

MOST_PRIMITIVES = 64
"""Allowed in a fit unless told otherwise."""


@dataclass(frozen=True, kw_only=True)
class FitStage:
    """A stage in which starts are fitted to their regions: each stage is sharper and has fewer of them."""

    sharpness: float
    """In units of 1 / (half thickness of the region)."""
    iterations: int
    """Levenberg steps."""
    keep: int
    """Starts kept a region."""
    half: bool = False
    """Whether every other point will do."""


@dataclass(frozen=True, kw_only=True)
class ProposeConfig:
    """Candidate fits of one round."""

    regions: int = 72
    """Most regions tried in a round."""
    splits: int = 12
    """Primitives, the worst ones, whose parts are tried anew."""
    merges: int = 32
    """Touching pairs of primitives that are tried as one."""
    blocks: bool = True
    """Whether pieces of a tree of boxes are tried."""
    slabs: bool = True
    """Whether pieces between changes of the cross-section are tried."""
    holes: bool = True
    """Whether walls around holes are tried."""
    points: int = 512
    """Sample points a region is fitted to, half of them in stages that ask for half."""
    stages: tuple[FitStage, ...] = (
        FitStage(sharpness=2.0, iterations=0, keep=14, half=True),
        FitStage(sharpness=2.0, iterations=4, keep=8, half=True),
        FitStage(sharpness=3.0, iterations=5, keep=5, half=True),
        FitStage(sharpness=6.0, iterations=6, keep=2),
        FitStage(sharpness=12.0, iterations=12, keep=1),
    )


@dataclass(frozen=True, kw_only=True)
class SelectConfig:
    """Greedy forward selection."""

    beam: int = 4
    """First picks that are followed up side by side."""


@dataclass(frozen=True, kw_only=True)
class RefineConfig:
    """Joint refinement of all primitives."""

    iterations: int = 24
    """Levenberg steps a round."""
    overlap: float = 0.3
    """Weight of the rows that push a second primitive out of a covered point."""
    betas: tuple[float, float] = (30.0, 150.0)
    """Sharpness of the occupancy at the start and end, per normalised unit."""


@dataclass(frozen=True, kw_only=True)
class PolishConfig:
    """The last step of a fit: blends are chosen and all primitives refined, in turn."""

    passes: int = 2
    merges: int = 4
    """Times that one candidate is tried in the place of several parts."""
    refine: RefineConfig = RefineConfig(iterations=30, overlap=0.3, betas=(120.0, 400.0))


@dataclass(frozen=True, kw_only=True)
class AdamConfig:
    """The paper-style optimiser (`optimizer="adam"`)."""

    steps: int = 300
    """Steps a round."""
    batch: int = 4096
    """Points a step."""
    rate: float = 0.02
    betas: tuple[float, float] = (15.0, 120.0)
    """Sharpness of the occupancy at the start and end, per normalised unit."""
    temperatures: tuple[float, float] = (1.0, 0.3)
    """Of the existence softmax, at the start and end."""
    count_weight: float = 1e-3
    quality_weight: float = 1e-2
    noise: float = 0.0
    """Standard deviation of noise on the sample positions at the start, normalised units; it shrinks to 0."""
    predicted: float = 0.0
    """Share of the points drawn near the predicted surface instead, 0 to 1: false volume far from the target shows."""
    resample: int = 25
    """Steps between draws of noisy and predicted points, whose distances are measured anew."""
    axis: Literal["fixed", "learned"] = "fixed"
    """Whether the sweep axis is the seed's, or learned among the seed's three."""
    axis_share: float = 0.5
    """Share of the steps after which a learned axis is settled."""


SHARP = (100.0, 400.0)
"""Sharpness of plain rounds: a blunt step would wash out what earlier rounds made fine."""

FAST_STAGES = (
    FitStage(sharpness=2.0, iterations=4, keep=8, half=True),
    FitStage(sharpness=3.0, iterations=4, keep=3, half=True),
    FitStage(sharpness=5.0, iterations=4, keep=1),
    FitStage(sharpness=12.0, iterations=7, keep=1),
)

THOROUGH_STAGES = (
    FitStage(sharpness=2.0, iterations=7, keep=12),
    FitStage(sharpness=5.0, iterations=8, keep=3),
    FitStage(sharpness=12.0, iterations=12, keep=1),
)

PRESETS: dict[str, dict[str, Any]] = {
    "fast": {
        "parsimony": 2.5e-3,
        "rounds": 4,
        "excursions": 0,
        "samples": 8192,
        "propose": ProposeConfig(regions=48, stages=FAST_STAGES),
        "select": SelectConfig(),
        "refine": RefineConfig(iterations=14),
        "sharpen": RefineConfig(iterations=14, betas=SHARP),
        "polish": PolishConfig(passes=1, merges=3),
    },
    "balanced": {
        "parsimony": 2.65e-3,
        "rounds": 25,
        "excursions": 1,
        "samples": 20_000,
        "propose": ProposeConfig(),
        "select": SelectConfig(),
        "refine": RefineConfig(),
        "sharpen": RefineConfig(betas=SHARP),
        "polish": PolishConfig(),
    },
    "best": {
        "parsimony": 8e-4,
        "rounds": 36,
        "excursions": 3,
        "samples": 20_000,
        "propose": ProposeConfig(regions=96, splits=16, merges=40, stages=THOROUGH_STAGES),
        "select": SelectConfig(beam=6),
        "refine": RefineConfig(iterations=36),
        "sharpen": RefineConfig(iterations=36, betas=SHARP),
        "polish": PolishConfig(passes=3, merges=16),
    },
}

FROM_PRESET: Any = None
"""Default of the fields that presets set: given a value, it wins over the preset."""


@dataclass(frozen=True, kw_only=True)
class FitConfig:
    """All options of a fit. What a preset sets and is not given comes from the preset.

    Raises:
        InputError: for an unknown preset or a value out of range: one sentence that names the option.
    """

    preset: Preset = "balanced"
    device: str = "auto"
    """Where the kernels run: auto (the CPU), cpu or cuda:0. The greedy choice runs on the CPU anyway."""
    seed: int = 0
    primitive: str = DEFAULT_FAMILY
    """Family that is fitted."""
    union: Literal["smooth", "hard"] = "smooth"
    decompose: Literal["msd", "coacd"] = "msd"
    """How the residual is cut: morphologically, or into convex pieces for comparison."""
    optimizer: Literal["levenberg", "adam"] = "levenberg"
    """"adam" is the paper's way: one seed a region and first-order steps."""
    adam: AdamConfig = AdamConfig()
    max_primitives: int = MOST_PRIMITIVES
    """Where fewer are allowed than the fit comes to, the best assembly of so few is found from it."""
    target_iou: float = 1.0
    """Stop once the 128^3 IoU reaches this; 1 is off."""
    tolerance: float = 0.0
    """Stop once the 95th percentile of the two-sided surface distance is below this, in the mesh's units; 0 is off."""
    timeout: float = 0.0
    """Seconds after which the best so far is returned; 0 is off."""
    rounds: int = FROM_PRESET
    probes: bool = True
    """Whether refinement watches points where primitives stick out of the target."""
    excursions: int = FROM_PRESET
    """Further beginnings of the search, before what all found is put together: every other one from nothing."""
    parsimony: float = FROM_PRESET
    """Objective that a primitive must bring (alpha)."""
    snap: bool = False
    """Make the result regular (`fitter/regularise/`): symmetry, canonical shapes, equal axes, sizes and centres."""
    pareto: bool = False
    """Find the best assembly of every number of parts too."""
    per_part: Literal["auto", "on", "off"] = "auto"
    """Fit the mesh's parts one by one; "auto" does so where several are worth a primitive and none is nearly all."""
    resolution: int = 128
    samples: int = FROM_PRESET
    """Points near the surface, and as many in the volume, that the objective is measured on."""
    propose: ProposeConfig = FROM_PRESET
    select: SelectConfig = FROM_PRESET
    refine: RefineConfig = FROM_PRESET
    """In rich rounds, which find where things go."""
    sharpen: RefineConfig = FROM_PRESET
    """In plain rounds."""
    polish: PolishConfig = FROM_PRESET

    def __post_init__(self) -> None:
        if self.preset not in PRESETS:
            raise InputError(f"--preset {self.preset}: there is no such preset; choose {', '.join(PRESETS)}.")
        for name, value in PRESETS[self.preset].items():
            if getattr(self, name) is FROM_PRESET:
                object.__setattr__(self, name, value)
        if self.primitive not in FAMILIES:
            raise InputError(
                f"--primitive {self.primitive}: there is no such family; choose {', '.join(FAMILIES)}."
            )
        checks = {
            "max_primitives": (self.max_primitives >= 1, "at least 1"),
            "target_iou": (0 < self.target_iou <= 1, "above 0 and at most 1"),
            "tolerance": (self.tolerance >= 0, "at least 0"),
            "timeout": (self.timeout >= 0, "at least 0"),
            "rounds": (1 <= self.rounds <= 100, "between 1 and 100"),
            "parsimony": (0 <= self.parsimony < 1, "at least 0 and below 1"),
            "seed": (self.seed >= 0, "at least 0"),
        }
        for name, (holds, wanted) in checks.items():
            if not holds:
                option = name.replace("_", "-")
                raise InputError(f"--{option} {getattr(self, name)} is out of range; it must be {wanted}.")


def preset_config(preset: str = "balanced", **options: Any) -> FitConfig:
    """The configuration of a preset with the given options changed; None leaves an option as the preset has it.

    Raises:
        InputError: for an unknown preset or a value out of range.
    """
    return FitConfig(preset=preset, **{name: value for name, value in options.items() if value is not None})  # type: ignore[arg-type]
