"""Settings of the stages of a fit, and the presets, which change several of them together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal


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
    without: tuple[str, ...] = ()
    """Names of proposals that are not asked (`decomposition/proposals/`)."""
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


ADAM = AdamConfig()
"""Unless told otherwise."""


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
