"""A small fit, its folder and its steps, for the tests of playback and films."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import trimesh

from resfit.assembly.assembly import Assembly
from resfit.cli import main

ARGUMENTS = ("--preset", "fast", "--rounds", "3", "--whole", "--device", "cpu")


@dataclass(frozen=True)
class SmallFit:
    """A mesh and the folder of its fit."""

    mesh: Path
    folder: Path

    @property
    def assembly(self) -> Assembly:
        """What the fit came to."""
        return Assembly.load(self.folder / "assembly.json")


def write_mesh(path: Path) -> Path:
    """A table of three legs, slightly tilted: few parts, none alike."""
    boxes = [((1.0, 0.12, 0.7), (0.0, 0.5, 0.0)), ((0.12, 0.9, 0.12), (-0.35, 0.0, 0.2)),
             ((0.12, 0.9, 0.12), (0.35, 0.0, 0.2)), ((0.2, 0.9, 0.1), (0.0, 0.0, -0.25))]  # fmt: skip
    parts = [
        trimesh.creation.box(extents, trimesh.transformations.translation_matrix(place))
        for extents, place in boxes
    ]
    mesh = trimesh.util.concatenate(parts)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.3, (1.0, 0.4, 0.2)))
    mesh.export(path)
    return path


def run_cli(*arguments: str | Path) -> int:
    """Run `resfit` in this process; the exit code."""
    return main([str(argument) for argument in arguments])


@cache
def small_fit() -> SmallFit:
    """The fit, made once."""
    base = Path(mkdtemp(prefix="resfit-test-"))
    mesh = write_mesh(base / "table.ply")
    assert run_cli("fit", mesh, "-o", base / "fit", *ARGUMENTS) == 0
    return SmallFit(mesh, base / "fit")
