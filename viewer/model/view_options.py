"""View options: what the keys of the viewer switch. Nothing here is part of a file, or of undo."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

from ...assembly.primitive import Vector

MeshMode = Literal["off", "ghost", "outline", "beside"]
MESH_MODES: tuple[MeshMode, ...] = ("off", "ghost", "outline", "beside")
Axis = Literal["x", "y", "z"]


@dataclass(frozen=True)
class View:
    """View options of a scene."""

    joined: bool = True
    """Where parts run smoothly into each other; else each part alone."""
    wireframe: bool = False
    edges: bool = True
    """Lines along sharp edges."""
    labels: bool = False
    explode: float = 0.0
    """How far parts are moved from their common middle, as a share of their distance from it."""
    section: Axis | None = None
    """Cut away everything beyond a plane across this axis."""
    section_at: float = 0.5
    """Where the plane lies, 0 to 1 of the whole."""
    slice: bool = False
    """Signed distances as colours on the plane of the section, or one across z."""
    mesh: MeshMode = "off"
    """The input mesh."""
    error: bool = False
    """The input's surface in the colours of its signed distance to the assembly."""
    residual: bool = False
    """Volume that the assembly lacks, and that it has too much."""
    samples: bool = False
    """Points on the input's surface, by their distance to the assembly."""
    across: Vector = (1.0, 0.0, 0.0)
    """Unit vector, scene's frame: where what stands beside goes; usually the camera's right."""


TOGGLES = (
    "joined", "edges", "wireframe", "labels", "explode", "section", "slice", "mesh", "error", "residual", "samples",
)  # fmt: skip
SWITCHES = (*TOGGLES, "section_back", "section_on")
COMPARING = ("mesh", "error", "residual", "samples")
"""Switches that need an input mesh."""

EXPLODED = 0.6
"""How far the switch moves parts apart."""
SECTION_STEP = 0.04
AXES: tuple[Axis | None, ...] = (None, "x", "y", "z")


def is_on(view: View, name: str) -> bool:
    """True if one of TOGGLES is on."""
    value = getattr(view, name)
    return value not in (None, "off", False, 0.0)


def switched(view: View, name: str, across: Vector) -> View:
    """The view after one of SWITCHES.

    Args:
        view: as it is.
        name: which switch; those with more than two positions go on to the next.
        across: the camera's right, for what is set side by side.
    """
    if name == "explode":
        return replace(view, explode=0.0 if view.explode else EXPLODED)
    if name == "section":
        return replace(view, section=AXES[(AXES.index(view.section) + 1) % len(AXES)])
    if name in ("section_back", "section_on"):
        step = SECTION_STEP if name == "section_on" else -SECTION_STEP
        return replace(view, section_at=min(1.0, max(0.0, view.section_at + step)))
    if name == "mesh":
        mode = MESH_MODES[(MESH_MODES.index(view.mesh) + 1) % len(MESH_MODES)]
        return replace(view, mesh=mode, across=across)
    change: Any = {name: not getattr(view, name)}
    return replace(view, **change)
