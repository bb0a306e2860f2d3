"""Scaling of a fit's stages with the mesh's faces, the grid, the primitives, the sample points, and disorder.

One thing grows at a time, the rest stays as it is. The faces are those of one closed surface cut more and more finely;
the primitives are found again from unions of so many apart parts.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from resfit.errors import InputError

from ...assembly.colors import PALETTE, palette_color
from ..report.figure import INK, logarithmic, svg_plot
from .fit_runs import STAGES, TARGET, FitRow, measure_fit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FEW: dict[str, tuple[int, ...]] = {
    "faces": (1024, 16_384, 262_144),
    "grid": (64, 128, 192),
    "primitives": (8, 32),
    "samples": (4096, 16_384, 65_536),
    "soup": (300, 3000),
}
"""What can grow, and the sizes unless others are given: few, since every one is a whole fit."""

LABELS = {
    "faces": "faces of the mesh",
    "grid": "cells along a side of the grid",
    "primitives": "parts of the mesh",
    "samples": "samples near the surface, and as many in the volume",
    "soup": "triangles across each other, without any order",
}
USUAL_FACES = 16_384
"""Of the mesh where something else grows."""
LEAST_SECONDS = 0.03
"""A stage that never takes this long has no exponent and no line in the chart: it would be noise."""
SHORTEST = 0.1 * LEAST_SECONDS
"""What took less is not counted for an exponent, and drawn at this height: the stage was skipped there."""


def read_sizes(text: str) -> dict[str, tuple[int, ...]]:
    """Sizes by what grows, from `faces=1k,64k,1M grid=64,128`; those of FEW for a bare name, everything for nothing.

    Raises:
        InputError: if there is no such thing, or a size is no number above 0.
    """
    sizes: dict[str, tuple[int, ...]] = {}
    for entry in text.replace(";", " ").split():
        axis, _, given = entry.partition("=")
        if axis not in FEW:
            raise InputError(f"--sizes {entry}: only {', '.join(FEW)} can grow.")
        sizes[axis] = tuple(_size(word) for word in given.split(",")) if given else FEW[axis]
    return sizes or dict(FEW)


def _size(word: str) -> int:
    """64k as 65536, 1M as 1048576."""
    factor = {"k": 1024, "M": 1024**2}.get(word[-1:], 1)
    digits = word[:-1] if factor > 1 else word
    if not (digits.isascii() and digits.isdigit()) or int(digits) < 1:
        raise InputError(f"--sizes: {word!r} is no size; give numbers such as 500, 64k or 1M.")
    return int(digits) * factor


def wavy_torus(faces: int) -> trimesh.Trimesh:
    """A closed torus with waves of about so many faces; those of 1024 x 4^n have exactly as many."""
    minor = max(3, round(math.sqrt(faces / 4.0)))
    mesh = trimesh.creation.torus(0.62, 0.25, major_sections=2 * minor, minor_sections=minor)
    around = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0])
    waves = (1 + 0.03 * np.sin(9 * around))[:, None]
    return trimesh.Trimesh(mesh.vertices * waves, mesh.faces, process=False)


def apart_parts(count: int, seed: int = 0) -> trimesh.Trimesh:
    """A mesh of `count` turned boxes, cylinders and balls, none of which touches another."""
    rng = np.random.default_rng(seed)
    side = math.ceil(count ** (1.0 / 3.0) - 1e-9)
    cells = rng.permutation(side**3)[:count]
    parts = []
    for index, cell in enumerate(cells):
        size = rng.uniform(0.45, 0.55, 3)
        part = (
            trimesh.creation.box(size),
            trimesh.creation.cylinder(0.5 * size[0], size[2], sections=48),
            trimesh.creation.icosphere(subdivisions=3, radius=0.5 * size[0]),
        )[index % 3]
        place = trimesh.transformations.random_rotation_matrix(rng.random(3))
        place[:3, 3] = np.unravel_index(cell, (side,) * 3)
        parts.append(part.apply_transform(place))
    return trimesh.Trimesh(*_joined(parts), process=False)


def triangle_soup(count: int, seed: int = 0) -> trimesh.Trimesh:
    """A mesh of `count` triangles, each of three random points of a box: nearly all cut many others."""
    corners = np.random.default_rng(seed).uniform(-1.0, 1.0, (3 * count, 3))
    return trimesh.Trimesh(corners, np.arange(3 * count).reshape(-1, 3), process=False)


def _joined(parts: Sequence[trimesh.Trimesh]) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and faces (m, 3) of some meshes together."""
    before = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + first for part, first in zip(parts, before, strict=False)]
    return np.concatenate([part.vertices for part in parts]), np.concatenate(faces)


def case(axis: str, size: int) -> tuple[trimesh.Trimesh, dict[str, Any]]:
    """The mesh, and the options of the fit, where `axis` has grown to `size`.

    Parts are not fitted one by one: that would be many small fits, of which nothing grows but the number.
    """
    options: dict[str, Any] = {"per_part": "off"}
    if axis == "faces":
        return wavy_torus(size), options
    if axis == "primitives":
        return apart_parts(size), options | {"max_primitives": max(64, 2 * size)}
    if axis == "soup":
        return triangle_soup(size), options
    return wavy_torus(USUAL_FACES), options | {"resolution" if axis == "grid" else "samples": size}


def measure_growth(
    sizes: Mapping[str, Sequence[int]],
    options: Mapping[str, Any],
    repeats: int,
    timeout: float | None,
    on_row: Callable[[FitRow], None],
) -> dict[str, dict[int, FitRow]]:
    """A row for each size of each axis.

    Args:
        sizes: see `read_sizes`.
        options: of every fit.
        repeats: runs of each.
        timeout: seconds a run.
        on_row: called with each row as it comes.
    """
    found: dict[str, dict[int, FitRow]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for axis, values in sizes.items():
            found[axis] = {}
            for size in sorted(set(values)):
                mesh, own = case(axis, size)
                path = Path(folder) / f"{axis}_{size}.ply"
                mesh.export(path)
                found[axis][size] = replace(
                    measure_fit(path, {**options, **own}, repeats, timeout), name=f"{axis} {size}"
                )
                on_row(found[axis][size])
    return found


def exponent(sizes: Sequence[int], seconds: Sequence[float]) -> float | None:
    """p where the seconds grow as size^p, by least squares of the logarithms; None where that says nothing."""
    pairs = [
        (math.log(size), math.log(each))
        for size, each in zip(sizes, seconds, strict=True)
        if each >= SHORTEST
    ]
    if len(pairs) < 2 or max(seconds) < LEAST_SECONDS:
        return None
    across, down = np.array(pairs).T
    return float(np.polyfit(across, down, 1)[0])


def _stage_series(rows: Mapping[int, FitRow]) -> Iterator[tuple[str, list[int], list[float]]]:
    """Name, sizes and seconds of each stage, the whole fit at the end; of the sizes that were finished."""
    done = {size: row for size, row in rows.items() if row.status == "ok"}
    for name in dict.fromkeys(name for row in done.values() for name in row.stages):
        yield name, list(done), [row.stages.get(name, 0.0) for row in done.values()]
    yield "all", list(done), [row.wall_s for row in done.values()]


def _target_seconds(row: FitRow) -> float:
    """Wall seconds of reading the mesh and measuring it."""
    return sum(row.stages.get(name, 0.0) for name in TARGET)


def growth_tables(grown: Mapping[str, Mapping[int, FitRow]], picture: str | None = None) -> str:
    """A section of a Markdown page: for each axis a line a stage and a column a size.

    Args:
        grown: of `measure_growth`.
        picture: file name of the chart, if there is one.
    """
    lines = ["", "## How the stages grow", ""]
    if picture is not None:
        lines += [f"![seconds by stage]({picture})", ""]
    lines.append("Wall seconds; p: a stage grows as size^p, by least squares.")
    for axis, rows in grown.items():
        done = [row for row in rows.values() if row.status == "ok"]
        failed = [f"{size}: {row.status}" for size, row in rows.items() if row.status != "ok"]
        lines += ["", f"### {LABELS[axis][0].upper()}{LABELS[axis][1:]}", ""]
        lines += [f"Failed at {sentence}." for sentence in failed]
        if not done:
            continue
        names = [str(size) for size, row in rows.items() if row.status == "ok"]
        lines += [f"| {axis} | {' | '.join(names)} | p |", "|---" * (len(done) + 2) + "|"]
        for name, sizes, seconds in _stage_series(rows):
            slope = exponent(sizes, seconds)
            shown = "" if slope is None else f"{slope:.2f}"
            lines.append(f"| {name} | {' | '.join(f'{value:.3f}' for value in seconds)} | {shown} |")
        for label, values in (
            ("load to samples", [f"{_target_seconds(row):.3f}" for row in done]),
            ("CPU s", [f"{row.cpu_s:.2f}" for row in done]),
            ("peak MB", [f"{row.peak_mb:.0f}" for row in done]),
            ("faces", [str(row.faces) for row in done]),
            ("primitives found", [str(row.primitives) for row in done]),
        ):
            lines.append(f"| {label} | {' | '.join(values)} | |")
    return "\n".join(lines) + "\n"


def chart(grown: Mapping[str, Mapping[int, FitRow]]) -> str:
    """An SVG with a panel for each axis: seconds of the stages against its size, both logarithmic."""
    panels = []
    for axis, rows in grown.items():
        series = [(name, xs, ys) for name, xs, ys in _stage_series(rows) if ys and max(ys) >= LEAST_SECONDS]
        if series:
            panels.append((axis, series))

    def draw(places: Sequence[Axes]) -> None:
        for axes, (axis, series) in zip(places, panels, strict=True):
            axes.set_xlabel(LABELS[axis])
            for name, xs, ys in series:
                axes.plot(xs, np.maximum(ys, SHORTEST), label=name, **_look(name))
            logarithmic(axes, "x")
            logarithmic(axes, "y")
            sizes = sorted({size for _, xs, _ in series for size in xs})
            axes.set_xticks(sizes, [_short(size) for size in sizes])

    return svg_plot(len(panels), draw, "Wall seconds of the stages of a fit")


def _look(stage: str) -> dict[str, Any]:
    """Colour and line of a stage, the same in every panel; the palette has fewer colours than there are stages."""
    number = list(STAGES).index(stage) if stage in STAGES else -1
    return {
        "color": palette_color(number) if number >= 0 else INK,
        "linestyle": "--" if number >= len(PALETTE) else "-",
        "linewidth": 2.0 if stage == "all" else 1.2,
        "marker": "o",
        "markersize": 3.0,
    }


def _short(size: int) -> str:
    """65536 as 64k."""
    for unit, name in ((1024**2, "M"), (1024, "k")):
        if size >= unit and size % unit == 0:
            return f"{size // unit}{name}"
    return str(size)
