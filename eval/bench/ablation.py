"""Ablation studies: our own fit in variants, on the same meshes, with a table each.

    resfit bench ablation MESH ... -o FOLDER

A study is a list of variants of the method `ours`; another one, or another row, is an entry of `STUDIES`. Fits and
rows are `compare`'s: what an earlier run into the same folder has finished is not done again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from resfit.errors import InputError

from ...decomposition.proposals import PROPOSALS
from ...kernels.primitives import DEFAULT_FAMILY, FAMILIES
from ..batch.compare import Comparison, run_comparison
from ..batch.datasets import Shape
from .ablation_sentences import (
    Means,
    moves_sentences,
    optimizer_sentences,
    primitive_sentences,
    rounds_sentences,
)

ROUNDS = 2
"""Of a variant that iterates: the paper's ablations have two."""


@dataclass(frozen=True)
class Variant:
    """One row of a table."""

    label: str
    method: str
    """As `resfit compare` takes it."""


@dataclass(frozen=True)
class Study:
    """One table."""

    name: str
    """As the command takes it."""
    title: str
    variants: tuple[Variant, ...]
    sentences: Callable[[Means], list[str]]
    """What the table says, from the means of its rows by their labels."""


def whole(**changes: Any) -> str:
    """A variant for two rounds, or as many as given, that fits the mesh as one whole.

    The other decomposition and optimiser do not fit parts one by one, so that their rows could not be compared.
    """
    return ours(**({"rounds": ROUNDS} | changes), per_part="off")


def ours(**changes: Any) -> str:
    """The method with some fields of the configuration changed; `__` in a name stands for the dot of a stage.

    Fields at their defaults are left out, so that equal fits have one name and are done once.
    """
    usual = {"primitive": DEFAULT_FAMILY, "union": "smooth", "decompose": "msd", "optimizer": "levenberg"}
    pairs = [
        f"{name.replace('__', '.')}={value}" for name, value in changes.items() if usual.get(name) != value
    ]
    return ":".join(["ours", ",".join(pairs)]) if pairs else "ours"


BY_NUMBERS = sorted(FAMILIES, key=lambda name: FAMILIES[name].parameter_count)
"""The families, those of few parameters first."""

PRIMITIVE = Study(
    "primitive",
    "Primitive family and union",
    tuple(
        Variant(f"{family}, {union}", whole(primitive=family, union=union))
        for union in ("smooth", "hard")
        for family in BY_NUMBERS
    ),
    primitive_sentences,
)

SINGLE_SHOT = Study(
    "rounds",
    "Single shot or residual rounds, by decomposition",
    tuple(
        Variant(f"{name}, {shown}", whole(decompose=decompose, rounds=rounds))
        for decompose, shown in (("msd", "MSD"), ("coacd", "CoACD"))
        for name, rounds in (("single shot", 1), ("ResFit", ROUNDS))
    ),
    rounds_sentences,
)

OPTIMIZER = Study(
    "optimizer",
    "Second-order steps or the paper's Adam",
    (
        Variant("Levenberg", whole()),
        Variant("Adam", whole(optimizer="adam")),
        Variant("Adam, learned sweep axis", whole(optimizer="adam", adam__axis="learned")),
    ),
    optimizer_sentences,
)

MOVES = Study(
    "moves",
    "What the moves contribute: the preset balanced with all its rounds, one feature switched off a row",
    (
        Variant("everything", ours()),
        Variant("one beginning", ours(excursions=0)),
        *(
            Variant(f"no {proposal.title}", ours(propose__without=name))
            for name, proposal in PROPOSALS.items()
            if proposal.title
        ),
        Variant("no splits", ours(propose__splits=0)),
        Variant("no pairs", ours(propose__merges=0)),
        Variant("no mergers at the end", ours(polish__merges=0)),
        Variant("no probes", ours(probes=False)),
        Variant("one first pick (no beam)", ours(select__beam=1)),
        Variant("no overlap rows", ours(refine__overlap=0)),
        Variant("hard union", ours(union="hard")),
        Variant("parts never one by one", ours(per_part="off")),
    ),
    moves_sentences,
)

STUDIES: dict[str, Study] = {study.name: study for study in (PRIMITIVE, SINGLE_SHOT, OPTIMIZER, MOVES)}


def check_studies(names: Sequence[str]) -> list[Study]:
    """The studies asked for.

    Raises:
        InputError: if there is none, or one is unknown.
    """
    asked = [name.strip() for name in names if name.strip()]
    for name in asked:
        if name not in STUDIES:
            raise InputError(f"there is no study '{name}'; choose {', '.join(STUDIES)}.")
    if not asked:
        raise InputError(f"give at least one study; there are {', '.join(STUDIES)}.")
    return [STUDIES[name] for name in dict.fromkeys(asked)]


def run_studies(
    studies: Sequence[Study],
    shapes: Sequence[Shape],
    out: Path,
    *,
    timeout: float | None = 600.0,
    device: str = "auto",
    fresh: bool = False,
    on_row: Callable[[dict[str, Any]], None] | None = None,
) -> dict[str, list[dict[str, Any]]]:
    """Rows of each study, by its name.

    Args:
        studies: of `STUDIES`.
        shapes: the meshes.
        out: folder for rows and results.
        timeout: seconds a fit.
        device: of the metrics.
        fresh: compute finished rows again.
        on_row: called with each row, finished before or not.
    """
    rows: dict[str, list[dict[str, Any]]] = {}
    for number, study in enumerate(studies):
        methods = tuple(variant.method for variant in study.variants)
        comparison = Comparison(out, methods, timeout, False, None, device, fresh and number == 0)
        rows[study.name] = run_comparison(comparison, shapes, on_row)
    return rows
