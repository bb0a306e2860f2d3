"""Editable parameters of a part, as sliders: its family's own table, its pose and its blend.

Names, groups, ranges and units are those of the page that `exports/html.py` writes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from resfit.errors import InputError

from ...assembly.primitive import Pose, Primitive, Vector
from ...kernels.primitives import FAMILIES
from .poses import to_angles, to_quaternion

FARTHEST = 1e3
"""Normalised units: no surface is made of what lies farther away (`assembly/surface.py`)."""

POSITION_RANGE, ANGLE_RANGE, BLEND_RANGE = (-1.0, 1.0), (-180.0, 180.0), (0.0, 1.0)
STEP, ANGLE_STEP = 0.001, 0.5
AXES = "xyz"


@dataclass(frozen=True)
class Slider:
    """One number of a part that can be edited."""

    id: str
    """`size.0`, `taper`, `translation.2`, `rotation.1`, `blend`: parameter, and component where there are several."""
    group: str
    """Shape, Position, Rotation or Join."""
    label: str
    unit: str
    """"length" (normalised units), "ratio" or "degrees"."""
    description: str
    range: tuple[float, float]
    """What the slider offers; wider than the table's where the value lies beyond that."""
    legal: tuple[float, float]
    """What a value may be at all."""
    step: float
    value: float


def part_sliders(part: Primitive, first: bool = False, angles: Vector | None = None) -> tuple[Slider, ...]:
    """The sliders of a part, with their values.

    Args:
        part: which.
        first: whether it is the first of its assembly, whose blend is unused.
        angles: its turns about x, y and z in degrees, where they are known; else they follow from the quaternion.
    """
    made = []
    for entry in FAMILIES[part.family].parameters:
        numbers = _numbers(part.parameters[entry.name])
        for k, value in enumerate(numbers):
            many = entry.count > 1
            label = f"{entry.name} {AXES[k] if entry.count == 3 else k + 1}" if many else entry.name
            made.append(
                Slider(
                    f"{entry.name}.{k}" if many else entry.name, "Shape", label, entry.unit, entry.description,
                    _holding(entry.slider, value), entry.legal, STEP, value,
                )
            )  # fmt: skip
    far = (-FARTHEST, FARTHEST)
    for k, value in enumerate(part.pose.translation):
        made.append(
            Slider(
                f"translation.{k}", "Position", AXES[k], "length", "centre",
                _holding(POSITION_RANGE, value), far, STEP, value,
            )
        )  # fmt: skip
    for k, value in enumerate(angles or to_angles(part.pose.rotation)):
        made.append(
            Slider(
                f"rotation.{k}", "Rotation", f"about {AXES[k]}", "degrees", "turn",
                ANGLE_RANGE, (-360.0, 360.0), ANGLE_STEP, value,
            )
        )  # fmt: skip
    if not first:
        text = "radius of the smooth union with the parts before it"
        made.append(
            Slider(
                "blend", "Join", "blend", "length", text,
                _holding(BLEND_RANGE, part.blend), (0.0, FARTHEST), STEP, part.blend,
            )
        )  # fmt: skip
    return tuple(made)


def with_value(part: Primitive, slider_id: str, value: float, angles: Vector | None = None) -> Primitive:
    """A part with one number changed.

    Args:
        part: which.
        slider_id: as in `Slider.id`.
        value: the new number, in the slider's unit; what is not legal becomes the nearest that is.
        angles: as in `part_sliders`.

    Raises:
        InputError: if the part has no such number, or the value is not finite.
    """
    slider = next((found for found in part_sliders(part, angles=angles) if found.id == slider_id), None)
    if slider is None:
        raise InputError(f"a {part.family} has nothing called '{slider_id}' to edit.")
    if not math.isfinite(value):
        raise InputError(f"{slider.label} cannot be {value}; give a finite number.")
    low, high = slider.legal
    value = min(max(value, low), min(high, FARTHEST))
    name, _, at = slider_id.partition(".")
    if name == "blend":
        return replace(part, blend=value)
    if name == "translation":
        return replace(part, pose=Pose(_changed(part.pose.translation, at, value), part.pose.rotation))
    if name == "rotation":
        turned = _changed(angles or to_angles(part.pose.rotation), at, value)
        return replace(part, pose=Pose(part.pose.translation, to_quaternion(turned)))
    old: Any = part.parameters[name]
    new = _changed(old, at, value) if at else value
    return replace(part, parameters={**part.parameters, name: new})


def _numbers(value: Any) -> tuple[float, ...]:
    return tuple(value) if isinstance(value, tuple) else (float(value),)


def _holding(offered: tuple[float, float], value: float) -> tuple[float, float]:
    return min(offered[0], value), max(offered[1], value)


def _changed(values: Any, at: str, value: float) -> Any:
    """The tuple `values` with one component replaced."""
    return tuple(value if str(k) == at else old for k, old in enumerate(values))
