"""Side by side: several `resfit fit` at once, into one folder and into many.

Wrong: one that ends other than with 0; a result that is not whole, or another than one alone gives; files left.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

from fuzz.campaigns import shuffled
from fuzz.commands import check_code, check_whole, ended, fit_command, leftovers, mesh_in, run, start
from fuzz.harness import Campaign, Case, Wrong

MANY = 8


def cases(rng: random.Random) -> Iterator[Case]:
    """Two into a new folder and over an earlier result, and eight into eight folders."""
    return shuffled(
        rng, [Case("two into one new folder"), Case("two over one result"), Case("eight at once")]
    )


def attempt(case: Case, folder: Path) -> str:
    """Start all, wait for all, look at all."""
    return eight(folder) if case.name.startswith("eight") else two(folder, case.name.endswith("result"))


def two(folder: Path, over: bool) -> str:
    """Two fits of other seeds into one folder."""
    mesh, out = mesh_in(folder, "two"), folder / "out"
    if over:
        check_code(run(fit_command(mesh, out, "--seed", "9"), folder), (0,))
    team = [start(fit_command(mesh, out, "--seed", str(seed)), folder) for seed in (1, 2)]
    for done in [ended(process) for process in team]:
        check_code(done, (0,))
    check_whole(out)
    if leftovers(folder):
        raise Wrong(f"they left {leftovers(folder)}")
    return "whole"


def eight(folder: Path) -> str:
    """Eight of the same fit: the bytes of one alone."""
    mesh = mesh_in(folder, "two")
    outs = [folder / f"out{number}" for number in range(MANY)]
    for done in [ended(process) for process in [start(fit_command(mesh, out), folder) for out in outs]]:
        check_code(done, (0,))
    check_code(run(fit_command(mesh, folder / "alone"), folder), (0,))
    found = {(out / "assembly.json").read_bytes() for out in (*outs, folder / "alone")}
    if len(found) != 1:
        raise Wrong(f"{MANY} fits at once and one alone gave {len(found)} different assemblies")
    return "same bytes"


CAMPAIGN = Campaign("side-by-side", cases, attempt, hang_s=240.0)
