"""Result of a fit, and the only place that writes a fit's folder."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from resfit.clock import Clock, peak_mb, timed
from resfit.errors import InputError

from ..assembly.assembly import Assembly
from ..assembly.atomic_write import write_bytes
from ..assembly.colors import rgb
from ..assembly.history import History
from ..assembly.report import FORMAT, REPORT
from ..eval.metrics.assembly_metrics import Deviation
from ..exports.by_suffix import export_assembly
from ..exports.facts import report_facts, up_axis
from ..exports.html import MAX_PARTS
from ..exports.overlay import Triangles
from ..fitter.outcome import Status
from ..kernels.contour.isosurface import tight_bounds
from ..kernels.render.camera import frame_bounds
from ..kernels.render.raytrace import render_assembly, render_mesh
from ..kernels.runtime.cores import core_count
from ..kernels.runtime.launch import choose_device, side_by_side
from ..shape.target import Target
from .folder import filling
from .pareto import Curve

REPORT_VERSION = 1

LEAST_IOU = 0.005
"""An assembly that matches less of the solid than this, with a deviation above the next, is no result."""

MOST_DEVIATION = 0.2
"""Normalised; the longest side is 1.8."""

PANEL = (480, 360)
"""Width and height of each half of the preview, in pixels."""

CLOSED_KINDS = ("closed", "flipped", "reoriented", "union")
"""Kinds of solids whose inside the mesh itself tells: IoU is a headline for these only."""


@dataclass(frozen=True)
class InputInfo:
    """Record of the input, and what it was decided to be."""

    name: str
    """The file's name without its folder; `mesh` for one in memory."""
    sha256: str
    vertices: int
    faces: int
    kind: str
    """closed, flipped, reoriented, union, winding, shell or mixed."""
    closed: bool
    sentence: str
    """What the solid was decided to be."""
    notes: tuple[str, ...]
    """What else was changed on the way."""
    reader: str = ""
    """What read the file, with its version."""


@dataclass(frozen=True)
class FitResult:
    """An assembly, how good it is, and how it came about."""

    assembly: Assembly
    """In the input's frame and units, by its transform."""
    status: Status
    """Why the fit stopped; its value is a sentence."""
    history: History
    """Every round."""
    metrics: dict[str, float | int]
    """iou, overlap, unoverlap, primitive_count, floats, cpu_s, wall_s, peak_mb."""
    timings: dict[str, float]
    """Wall seconds by stage; `compile` is contained in the stages in which kernels were compiled or loaded."""
    input: InputInfo
    deviation: Deviation | None
    """Distances between the two surfaces in mesh units; None if the assembly has no surface."""
    objective: dict[str, float]
    """The objective and its parts, on the fit's samples."""
    gains: tuple[float, ...]
    """By how much the objective falls without each part."""
    placeholder: bool
    """Whether the fit was stopped before it found a part: then the assembly is one part, the bounding box's."""
    target: Target = field(repr=False)
    """What was fitted, normalised."""
    options: Mapping[str, Any] = field(default_factory=dict)
    device: str = "cpu"
    relations: tuple[Mapping[str, Any], ...] = ()
    """What parts have exactly in common: kind, parts by name, value; lengths are normalised."""
    snapped: str = ""
    """The relations in a few words; empty unless the assembly was made regular."""
    notes: tuple[str, ...] = ()
    """Sentences about how it was fitted."""
    curve: Curve | None = field(default=None, repr=False)
    """The best assembly of each number of parts, if that was asked for."""

    def save(self, directory: str | Path) -> Path:
        """Write assembly.json, parts.glb, preview.png, viewer.html, history.npz and report.json.

        The folder is filled at once or not at all. One that exists is used if it is empty or holds an earlier fit,
        whose files are replaced: in one operation too, or where that is not possible the report goes first and comes
        last, so that a mixture is never taken for a fit.

        Raises:
            InputError: if the assembly is empty, the folder holds something else, or cannot be written.
        """
        if not self.assembly.primitives:
            raise InputError(
                f"no part raised the objective for '{self.input.name}', so nothing was written; look at the mesh,"
                " or lower --parsimony."
            )
        if self._is_wreck():
            raise InputError(
                f"what was found for '{self.input.name}' matches nothing of it, so nothing was written; its parts are"
                " too small for the space between them: fit them from files of their own."
            )
        clock, timings = Clock.now(), dict(self.timings)
        folder = Path(directory)
        with filling(folder) as temporary:
            jobs = (
                *self._halves(),
                lambda: export_assembly(self.assembly, temporary / "parts.glb", device=self.device),
                lambda: self._write_rest(temporary),
            )
            with side_by_side(*jobs) as (made, given, *files):
                with timed(timings, "preview"):
                    image = np.concatenate([given.result(), made.result()], axis=1)
                    (temporary / "preview.png").write_bytes(_png_bytes(image))
                with timed(timings, "parts"):
                    for file in files:
                        file.result()
            metrics = self.metrics | {
                "cpu_s": self.metrics["cpu_s"] + clock.cpu_s,
                "wall_s": self.metrics["wall_s"] + clock.wall_s,
                "peak_mb": peak_mb(),
            }
            text = json.dumps(self.report(metrics, timings), indent=2, allow_nan=False)
            write_bytes(temporary / REPORT, f"{text}\n".encode())
        return folder

    def _is_wreck(self) -> bool:
        """True if the assembly matches neither the solid nor the surface of the input."""
        far = MOST_DEVIATION * self.assembly.transform.scale
        # Cells miss what is thinner than they are: then the surface tells.
        return self.metrics["iou"] < LEAST_IOU and (self.deviation is None or self.deviation.p95 > far)

    def _write_rest(self, folder: Path) -> None:
        """Everything but the picture, the parts' surfaces and the report."""
        self.assembly.save(folder / "assembly.json")
        self.history.save(folder / "history.npz")
        if self.curve is not None:
            self.curve.save(folder)
        if len(self.assembly.primitives) <= MAX_PARTS:
            self.write_page(folder / "viewer.html")

    def write_page(self, path: Path) -> None:
        """Write the page that shows and edits the assembly, with the input to compare it with."""
        mesh = Triangles(self.assembly.transform.to_mesh(self.target.vertices), self.target.faces)
        facts = report_facts(self.report(self.metrics, self.timings))
        export_assembly(self.assembly, path, mesh=mesh, up=self.up, title=self.input.name, facts=facts)

    @property
    def up(self) -> Literal["y", "z"]:
        """The axis that points up in pictures, by the input's format."""
        return up_axis(self.input.name)

    def report(self, metrics: Mapping[str, float], timings: Mapping[str, float]) -> dict[str, Any]:
        """The content of report.json, JSON values."""
        parts = [
            {"name": part.name, "family": part.family, "gain": round(gain, 6), "color": part.color}
            for part, gain in zip(self.assembly.primitives, self.gains, strict=True)
        ]
        return {
            "format": FORMAT,
            "version": REPORT_VERSION,
            "status": {
                "name": self.status.name.lower(),
                "sentence": self.status.value,
                "stopped_early": self.status.stopped_early,
                "placeholder": self.placeholder,
            },
            "input": {**asdict(self.input), "notes": list(self.input.notes)},
            "options": dict(self.options),
            "seed": self.assembly.provenance.seed,
            "resfit": self.assembly.provenance.resfit,
            "metrics": {name: _rounded(value) for name, value in metrics.items()},
            "deviation": None if self.deviation is None else asdict(self.deviation),
            "objective": {name: _rounded(value) for name, value in self.objective.items()},
            "parts": parts,
            "relations": [dict(relation) for relation in self.relations],
            "notes": list(self.notes),
            "rounds": [
                {"accepted": entry.accepted, **{key: _rounded(value) for key, value in entry.score.items()}}
                for entry in self.history.rounds
            ],
            "timings": {stage: round(seconds, 4) for stage, seconds in timings.items()},
            "machine": {"device": self.device, "cores": core_count()},
        }

    def preview(self) -> np.ndarray:
        """The input beside the assembly, by one camera: (height, width, 3) uint8, sRGB."""
        with side_by_side(*self._halves()) as (made, given):
            return np.concatenate([given.result(), made.result()], axis=1)

    def _halves(self) -> tuple[Callable[[], np.ndarray], Callable[[], np.ndarray]]:
        """Renderers of the assembly and of the input."""
        device = choose_device(self.device)
        target, primitives = self.target, self.assembly.on_device(self.device)
        width, height = PANEL
        lower, upper = target.lower, target.upper
        if len(primitives):
            # What sticks out of the input must be seen, but one part gone astray may not make all else small.
            found = np.clip(tight_bounds(primitives), -1.0, 1.0)
            lower, upper = np.minimum(lower, found[0]), np.maximum(upper, found[1])
        camera = frame_bounds(lower, upper, up=self.up, aspect=width / height)
        colors = np.array([rgb(part.color) for part in self.assembly.primitives]).reshape(-1, 3)
        return (
            lambda: render_assembly(primitives, colors, camera, width, height),
            lambda: render_mesh(target.vertices, target.faces, camera, width, height, device=device),
        )


def describe_input(target: Target, name: str | os.PathLike[str] | None) -> InputInfo:
    """Describe the input: the name of the file at `name`, without its folder, and the target's findings."""
    return InputInfo(
        # File names are bytes: some are no UTF-8, others only look so in a locale without it.
        name="mesh" if name is None else os.fsencode(Path(name).name).decode("utf-8", "replace"),
        sha256=target.input_sha256,
        vertices=len(target.vertices),
        faces=len(target.faces),
        kind=target.solid.kind,
        closed=target.solid.kind in CLOSED_KINDS,
        sentence=target.sentence,
        notes=tuple(target.notes),
        reader=target.reader,
    )


def _png_bytes(image: np.ndarray) -> bytes:
    """A picture (height, width, 3) uint8 as a PNG file."""
    from io import BytesIO

    from PIL import Image

    buffer = BytesIO()
    Image.fromarray(image).save(buffer, "PNG", compress_level=4)
    return buffer.getvalue()


def _rounded(value: float) -> float | int:
    """Six digits behind the point say all that 128^3 cells and 20 000 samples can tell."""
    return value if isinstance(value, int) else round(value, 6)
