"""Assemblies for the tests of the viewer, and whether pictures can be drawn here."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest

from resfit.assembly.assembly import Assembly
from resfit.assembly.colors import palette_color
from resfit.assembly.primitive import Pose, Primitive
from resfit.assembly.transform import Transform
from resfit.kernels.primitives import FAMILIES
from resfit.viewer.model.parameters import with_value
from resfit.viewer.scene.opengl_check import probe_rendering


@cache
def reason_not_to_draw() -> str:
    """Why nothing can be drawn here; empty if it can."""
    probe = probe_rendering()
    return "" if probe.works else f"VTK cannot draw here: {probe.detail}"


def need_drawing() -> None:
    """Skip a test where nothing can be drawn."""
    if reason_not_to_draw():
        pytest.skip(reason_not_to_draw())


def primitive(family: str, name: str, place: tuple[float, float, float], blend: float = 0.0) -> Primitive:
    """A primitive with its family's defaults."""
    values: dict[str, Any] = {
        entry.name: entry.default if entry.count > 1 else entry.default[0]
        for entry in FAMILIES[family].parameters
    }
    return Primitive(family, name, Pose(place), values, blend, palette_color(len(name)))


def chain(blend: float = 0.0) -> Assembly:
    """One part of each family in a row along x, none alike, far from the mesh's origin."""
    places = (-0.6, -0.2, 0.2, 0.6)
    parts = [
        primitive(family, f"p{k}_{family}", (x, 0.1 * k, 0.0), blend)
        for k, (family, x) in enumerate(zip(FAMILIES, places, strict=True))
    ]
    parts = [with_value(part, "size.0", 0.3 + 0.05 * k) for k, part in enumerate(parts)]
    parts = [with_value(part, "rotation.1", 17.0 * k) for k, part in enumerate(parts)]
    return Assembly(tuple(parts), Transform(2.5, (100.0, -20.0, 3.0)))
