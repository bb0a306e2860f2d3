"""The current folder: commands run where Python files of usual names lie. None of them may be run.

A console script does not look for modules there; the processes that it starts must not either.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

from fuzz.campaigns import shuffled
from fuzz.commands import RESFIT, check_code, fit_command, mesh_in, run
from fuzz.harness import Campaign, Case, Wrong

PLANTED = (
    "numpy", "scipy", "trimesh", "warp", "pydantic", "pyvista", "vtkmodules", "playwright", "queue", "random", "resfit",
    "sitecustomize", "usercustomize", "PIL", "coacd", "lxml", "pickle", "gc",
)  # fmt: skip

COMMANDS = {
    "fit": "fit box.stl --preset fast --max-primitives 1 -o other",
    "view --screenshot": "view box.resfit --screenshot x.png --size 64x64",
    "doctor": "doctor",
    "gallery": "gallery box.stl -o g --preset fast",
    "eval": "eval box.resfit box.stl",
    "export": "export box.resfit x.obj",
    "compare": "compare box.resfit box.resfit -o c",
    "bench fit": "bench fit box.stl --preset fast",
}
"""By name: what is run after one fit to box.resfit."""


def cases(rng: random.Random) -> Iterator[Case]:
    """Each command once."""
    return shuffled(rng, [Case(name) for name in COMMANDS])


def attempt(case: Case, folder: Path) -> str:
    """Run one command among planted modules."""
    check_code(run(fit_command(mesh_in(folder), folder / "box.resfit"), folder), (0,))
    ran = folder / "RAN"
    for module in PLANTED:
        text = f"open({str(ran)!r}, 'a').write('{module} ')\nraise ImportError('planted')\n"
        (folder / f"{module}.py").write_text(text)
    done = run([RESFIT, *COMMANDS[case.name].split()], folder)
    if ran.exists():
        raise Wrong(
            f"{case.name} ran {' '.join(sorted(set(ran.read_text().split())))}; exit code {done.code}"
        )
    return f"exit code {done.code}"


CAMPAIGN = Campaign("current-folder", cases, attempt, hang_s=240.0)
